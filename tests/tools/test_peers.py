#!/usr/bin/env python3
"""bench/arena: batches made and read, and peers that answer contacts with known answers.

Run as a program it exits with 77 (skipped) when numpy or h5py is missing, and says which. A peer that is not installed skips its
own test.
"""
import sys
import tempfile
import unittest
from pathlib import Path

BENCH = Path(__file__).resolve().parents[2] / "bench"
sys.path.insert(0, str(BENCH / "arena"))

try:
    import numpy as np

    import boxed
    import engine_programs
    import siconos
    import systems
    from environments import BOX, FRICTION, UNILATERAL, Environment, read_environments, write_batch
except ImportError as missing:
    print(f"SKIPPED: the peers are not tested, {missing}")
    sys.exit(77)

try:
    import conic
except ImportError:
    conic = None

try:
    import mujoco_rows
except ImportError:
    mujoco_rows = None


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

    def test_what_siconos_can_treat(self):
        self.assertEqual(siconos.contact_size([STICKING], "coulomb"), 3)
        self.assertEqual(siconos.contact_size([STICKING], "convex"), 0)
        self.assertEqual(siconos.contact_size([LCP], "coulomb"), 1)
        self.assertEqual(siconos.contact_size([LCP, STICKING], "coulomb"), 0)

    def test_siconos_finds_the_known_answers(self):
        with tempfile.TemporaryDirectory() as folder:
            program = siconos.build(folder)
            if program is None:
                self.skipTest("Siconos or a C compiler is not installed")
            for solver in siconos.SOLVERS[3]:
                (reaction, _, how), = siconos.solve(program, [STICKING], 3, solver, 1e-10, 10000, 5.0, folder)
                np.testing.assert_allclose(reaction, ANSWER, atol=1e-6, err_msg=solver)
                self.assertEqual(how, 0)

    def find_boxed_answers(self, name):
        """A unit mass on the ground, pressed on with 2 and pushed along both tangents: each is held at -1 or 1, or sticks."""
        cases = [((3, 0), (2, -1, 0)), ((-3, 0.5), (2, 1, -0.5)), ((3, -4), (2, -1, 1))]
        with tempfile.TemporaryDirectory() as folder:
            program = engine_programs.build(name, folder)
            if program is None:
                self.skipTest(f"{name} is not installed")
            blocks = [Environment(np.arange(4) * 3, np.tile(np.arange(3), 3), np.eye(3).ravel(), np.array([-2.0, *push]), np.zeros(3),
                                  np.array([FRICTION]), np.array([0, 3]), np.array([0, 0.5, 0.5])) for push, _ in cases]
            path = engine_programs.write(Path(folder, "in.bin"),
                                         [engine_programs.boxed_records(boxed.of_environment(one)) for one in blocks])
            for solver in ("dantzig", "pgs"):
                answers = engine_programs.solve(program, solver, 100, 0.0, path, [3] * 3, folder)
                for (found, _, _, how), (_, expected) in zip(answers, cases, strict=True):
                    np.testing.assert_allclose(found, expected, atol=1e-9, err_msg=f"{name} {solver}")
                    self.assertEqual(how, engine_programs.SOLVED)

    def test_bullet_finds_the_known_answers(self):
        self.find_boxed_answers("Bullet f64")

    def test_dart_finds_the_known_answers(self):
        self.find_boxed_answers("DART")

    def test_clarabel_finds_the_known_answer(self):
        if conic is None:
            self.skipTest("Clarabel is not installed")
        reaction, _, claimed = conic.solve(STICKING, 1e-10, 5.0)
        np.testing.assert_allclose(reaction, ANSWER, atol=1e-6)
        self.assertTrue(claimed)

    @unittest.skipIf(mujoco_rows is None, "MuJoCo is not installed")
    def test_mujoco_finds_the_known_answers(self):
        # Two degrees of freedom hang on the first, which STICKING's A does not see; a box row and a limit come before it.
        M = np.diag([1, 2, 2, 2, 1, 1.0])
        M[0, 1:3] = M[1:3, 0] = 0.5
        J = np.zeros((5, 6))
        J[0, 3], J[1, 4] = 1, 1
        J[2:, [5, 0, 2]] = np.diag([1, 1, 1])
        A = J @ np.linalg.solve(M, J.T)
        compliance, reaction = np.full(5, 0.25), np.array([-0.5, 0, 1, -0.1, 0.2])
        motion = np.array([0.3, 0.7, 0, 0, 0])  # the box is at its lower bound and moves up, the limit is left
        b = motion - (A + np.diag(compliance)) @ reaction
        problem = Environment(np.arange(6) * 5, np.tile(np.arange(5), 5), A.ravel(), b, compliance, np.array([BOX, UNILATERAL, FRICTION]),
                              np.array([0, 1, 2, 5]), np.array([0.5, 0, 0, 0.5, 0.5]))
        v_free = np.array([0.1, -0.2, 0.3, 0, 0, 0.4])
        system = systems.System(problem, J, M, v_free, J @ v_free - b)
        with tempfile.TemporaryDirectory() as folder:
            functions = mujoco_rows.build(folder)
            if functions is None:
                self.skipTest("no C compiler, or no headers of MuJoCo")
            peer = mujoco_rows.Peer(functions, [system] * 2)
            for solver in mujoco_rows.SOLVERS:
                peer.choose(solver, 1e-14, False)
                peer.start(np.zeros((2, 6)))
                peer.factor()
                peer.project()
                peer.solve()
                found, iterations = peer.answer()
                np.testing.assert_allclose(found, np.tile(reaction, 2), atol=1e-6, err_msg=solver)
                self.assertTrue((iterations > 0).all())
            peer.close()

    @unittest.skipIf(mujoco_rows is None, "MuJoCo is not installed")
    def test_the_tree_of_a_mass_matrix(self):
        branches = np.eye(5)
        for dof, ancestor in ((1, 0), (2, 1), (3, 0), (2, 0)):  # 0 - 1 - 2, 0 - 3, and 4 alone
            branches[dof, ancestor] = branches[ancestor, dof] = 0.1
        self.assertEqual(mujoco_rows.parents([branches]).tolist(), [-1, 0, 1, 0, -1])
        branches[2, 0] = branches[0, 2] = 0  # a zero by chance: 1 still hangs on 0
        branches[3, 2] = branches[2, 3] = 0.1  # 3 hangs on 2, which has 1 and 0 above
        self.assertEqual(mujoco_rows.parents([branches, np.eye(5)]).tolist(), [-1, 0, 1, 2, -1])

    def test_the_blocks_of_a_mass_matrix(self):
        whole, halves = np.ones((6, 6)), np.kron(np.eye(2), np.ones((3, 3)))
        for size, M in ((1, np.eye(6)), (3, halves), (0, whole)):
            self.assertEqual(systems.mass_block([systems.System(LCP, None, M, None, None)]), size)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
