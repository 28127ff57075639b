#!/usr/bin/env python3
"""bench/peers: batches made and read, the symmetric part, and peers that answer a contact with a known answer.

Run as a program it exits with 77 (skipped) when numpy or h5py is missing, and says which. A peer that is not installed skips its
own test.
"""
import sys
import tempfile
import unittest
from pathlib import Path

BENCH = Path(__file__).resolve().parents[2] / "bench"
sys.path[:0] = [str(BENCH / "peers"), str(BENCH)]

try:
    import numpy as np

    import against
    import siconos
    from environments import FRICTION, UNILATERAL, Environment, read_environments, write_batch
except ImportError as missing:
    print(f"SKIPPED: the peers are not tested, {missing}")
    sys.exit(77)


def dense(environment):
    offsets, columns, values = environment.with_compliance()
    matrix = np.zeros((environment.rows,) * 2)
    np.add.at(matrix, (np.repeat(np.arange(environment.rows), np.diff(offsets)), columns), values)
    return matrix


def environment(matrix, b, kinds, cone_offsets, row_param, name=""):
    n = len(b)
    return Environment(np.arange(n + 1) * n, np.tile(np.arange(n), n), np.ravel(np.array(matrix, "f8")), np.array(b, "f8"),
                       np.arange(n) / 8.0, np.array(kinds), np.array(cone_offsets), np.array(row_param, "f8"), name)


# Sticks under both laws: reaction (1, -0.1, 0.2) / A + R, within mu = 0.5.
STICKING = environment(np.diag([1, 0.875, 0.75]), [-1, 0.1, -0.2], [FRICTION], [0, 3], [0, 0.5, 0.5], "sticking")
ANSWER = [1, -0.1, 0.2]
LCP = environment([[-1, 2], [0, 1]], [-1, 3], [UNILATERAL] * 2, [0, 1, 2], [0, 0], "lcp")


class Peers(unittest.TestCase):
    def test_a_batch_is_read_as_it_was_written(self):
        with tempfile.TemporaryDirectory() as folder:
            write_batch(Path(folder, "batch.h5"), [STICKING, LCP], "coulomb", "test")
            read = read_environments(Path(folder, "batch.h5"))
        for one, other in zip(read, (STICKING, LCP), strict=True):
            for field, value in vars(other).items():
                np.testing.assert_array_equal(getattr(one, field), value, field)

    def test_the_symmetric_part(self):
        np.testing.assert_array_equal(dense(LCP.symmetric()), [[-1, 1], [1, 1.125]])

    def test_what_siconos_can_treat(self):
        self.assertEqual(siconos.contact_size([STICKING], "coulomb"), 3)
        self.assertEqual(siconos.contact_size([STICKING], "convex"), 0)
        self.assertEqual(siconos.contact_size([LCP], "coulomb"), 1)
        self.assertEqual(siconos.contact_size([LCP, STICKING], "coulomb"), 0)

    def test_a_negative_reaction_on_a_negative_diagonal_is_seen(self):
        self.assertEqual(against.hidden_residual(LCP, np.array([-1.0, 0.0])), 2 / 3)  # w = 0 there: |min(2 (-1), 0)| / 3
        self.assertEqual(against.hidden_residual(STICKING, np.array([-1.0, 0.0, 0.0])), 0)

    def test_siconos_finds_the_known_answers(self):
        with tempfile.TemporaryDirectory() as folder:
            program = siconos.build(folder)
            if program is None:
                self.skipTest("Siconos or a C compiler is not installed")
            for solver in siconos.SOLVERS[3]:
                (reaction, _, how), = siconos.solve(program, [STICKING], 3, solver, 1e-10, 10000, 5.0, folder)
                np.testing.assert_allclose(reaction, ANSWER, atol=1e-6, err_msg=solver)
                self.assertEqual(how, 0)

    def test_clarabel_finds_the_known_answer(self):
        if against.conic is None:
            self.skipTest("Clarabel is not installed")
        reaction, _, claimed = against.conic.solve(STICKING, 1e-10, 5.0)
        np.testing.assert_allclose(reaction, ANSWER, atol=1e-6)
        self.assertTrue(claimed)


if __name__ == "__main__":
    unittest.main()
