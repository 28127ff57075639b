#!/usr/bin/env python3
"""bench/peers, boxed friction: its residual, its LCP, rigid bodies recovered from J and M, and engines that find known answers.

Run as a program it exits with 77 (skipped) when numpy or h5py is missing, and says which. An engine that is not installed skips
its own test, and so does SciPy.
"""
import sys
import tempfile
import unittest
from pathlib import Path

BENCH = Path(__file__).resolve().parents[2] / "bench"
sys.path[:0] = [str(BENCH / "peers"), str(BENCH / "studies")]

try:
    import numpy as np

    import boxed
    import engine_programs as programs
    import rigid
    from environments import FRICTION, Environment
except ImportError as missing:
    print(f"SKIPPED: the engines are not tested, {missing}")
    sys.exit(77)

ROUNDING = 1e-14  # numbers of the order of 1, sums of fewer than ten


def block(push):
    """A unit mass on the ground, pressed on with 2 and pushed along both tangents, mu = 0.5."""
    return Environment(np.arange(4) * 3, np.tile(np.arange(3), 3), np.eye(3).ravel(), np.array([-2.0, *push]), np.zeros(3),
                       np.array([FRICTION]), np.array([0, 3]), np.array([0, 0.5, 0.5]))


# Push, reaction, and the LCP's (x_n, p, v): each tangent is held at -1 or 1, or sticks.
CASES = [((3, 0), (2, -1, 0), (2, 0, 1, 0, 0)),
         ((-3, 0.5), (2, 1, -0.5), (2, 2, 0.5, 2, 0)),
         ((3, -4), (2, -1, 1), (2, 0, 2, 0, 3))]


def tilted_box(twist=(0.1, -0.2, -1, 0.3, 0.1, -0.2)):
    """(J, M, v, param) of a box on a tilted floor with another on one of its corners, by the formulas of a contact."""
    rng = np.random.default_rng(3)
    frame, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    frame *= np.linalg.det(frame)
    contacts = [(-1, 0, arm, arm) for arm in rng.standard_normal((4, 3))] + [(0, 1, *rng.standard_normal((2, 3)))]
    J = np.zeros((15, 12))
    for k, (a, b, arm_a, arm_b) in enumerate(contacts):
        for axis, direction in enumerate(frame):
            J[3 * k + axis, 6 * b:6 * b + 6] = *direction, *np.cross(arm_b, direction)
            if a >= 0:
                J[3 * k + axis, 6 * a:6 * a + 6] = *-direction, *-np.cross(arm_a, direction)
    M = np.zeros((12, 12))
    for body, mass in enumerate((2.0, 3.0)):
        root = rng.standard_normal((3, 3))
        M[6 * body:6 * body + 3, 6 * body:6 * body + 3] = mass * np.eye(3)
        M[6 * body + 3:6 * body + 6, 6 * body + 3:6 * body + 6] = root @ root.T + np.eye(3)
    return J, M, np.tile(twist, 2), np.tile([0, 0.5, 0.5], 5)


def cube(speed, mass=2.0):
    """A cube on four contacts, falling and sliding slowly: it sticks, and the floor takes its momentum."""
    corners = 0.1 * np.array([(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)], float)
    return rigid.Scene(np.array([mass]), np.array([np.diag([1, 2, 3]) * 0.01]), np.zeros((1, 3)),
                       np.array([[0.05 * speed, 0, -speed, 0, 0, 0]]), np.tile([-1, 0], (4, 1)), corners,
                       np.tile(np.eye(3)[[2, 0, 1]], (4, 1, 1)), np.full(4, 0.5))


class BoxedFriction(unittest.TestCase):
    def test_known_answers_have_no_residual(self):
        for push, reaction, _ in CASES:
            self.assertLessEqual(boxed.residual(boxed.of_environment(block(push)), np.array(reaction, float)), ROUNDING, push)

    def test_the_residual_of_wrong_answers(self):
        problem = boxed.of_environment(block((3, 0)))
        self.assertAlmostEqual(boxed.residual(problem, np.array([2.0, -2, 0])), 1 / 3)  # 1 beyond its bound, max|b| = 3
        self.assertAlmostEqual(boxed.residual(problem, np.array([1.0, -0.5, 0])), 1 / 3)  # w_n = -1
        self.assertEqual(boxed.residual(problem, np.array([np.nan, 0, 0])), np.inf)

    def test_the_lcp_has_the_same_answers(self):
        for push, reaction, z in CASES:
            environment, back = boxed.as_lcp(boxed.of_environment(block(push)))
            z = np.array(z, float)
            np.testing.assert_allclose(back @ z, reaction, atol=ROUNDING)
            motion = boxed.dense(environment) @ z + environment.b
            self.assertGreaterEqual(motion.min(), -ROUNDING)
            np.testing.assert_allclose(z * motion, 0, atol=ROUNDING)

    def test_edges_of_a_pyramid(self):
        factors = np.array([0.9, 1.1, 0.7, 0.3]) / 1.5
        reaction = np.array([factors.sum(), 0.5 * (factors[0] - factors[1]), 0.5 * (factors[2] - factors[3])])
        environment = boxed.edges(block(-reaction[1:]))  # a push that these reactions cancel
        self.assertAlmostEqual(reaction[0], 2)
        self.assertLessEqual(boxed.residual(boxed.plain(environment), factors), ROUNDING)
        self.assertGreater(boxed.residual(boxed.plain(environment), factors * 0.9), 0.01)

    def test_lcps_against_scipy(self):
        try:
            from scipy.optimize import nnls
        except ImportError:
            self.skipTest("SciPy is not installed")
        rng = np.random.default_rng(7)
        for _ in range(20):  # min |R x - c| over x >= 0 is the LCP of R'R and -R'c
            root, right = rng.standard_normal((12, 8)), rng.standard_normal(12)
            answer, _ = nnls(root, right)
            problem = boxed.plain(boxed.lcp(root.T @ root, -root.T @ right))
            self.assertLess(boxed.residual(problem, answer), 1e-12)  # condition of R below 100, twelve terms a sum
            self.assertGreater(boxed.residual(problem, answer + 0.01), 1e-3)


class RigidBodies(unittest.TestCase):
    def test_bodies_from_a_jacobian_give_the_same_problem(self):
        J, M, velocity, param = tilted_box()
        scene = rigid.scene(J, M, velocity, param)
        np.testing.assert_array_equal(scene.pairs, [(-1, 0)] * 4 + [(0, 1)])
        environment = scene.environment()
        np.testing.assert_allclose(boxed.dense(environment), J @ np.linalg.solve(M, J.T), atol=1e-13)  # of numbers up to 10
        np.testing.assert_allclose(environment.b, J @ velocity, atol=1e-14)
        self.assertEqual(len(scene.records()), 16 + 2 * 31 * 8 + 5 * 15 * 8)  # the sizes of engine_run.hpp


class Engines(unittest.TestCase):
    def solve(self, name, solver, iterations, records, rows):
        with tempfile.TemporaryDirectory() as folder:
            path = programs.write(Path(folder, "in.bin"), records)
            return programs.solve(self.program(name), solver, iterations, 0.0, path, rows, folder)

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.built = {}

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def program(self, name):
        if name not in self.built:
            self.built[name] = programs.build(name, self.folder.name)
        if self.built[name] is None:
            self.skipTest(f"{name} is not installed")
        return self.built[name]

    def find_known_answers(self, name, solvers):
        records = [programs.boxed_records(boxed.of_environment(block(push))) for push, *_ in CASES]
        for solver in solvers:
            for (found, _, _, how), (_, expected, _) in zip(self.solve(name, solver, 100, records, [3] * 3), CASES):
                np.testing.assert_allclose(found, expected, atol=1e-9, err_msg=f"{name} {solver}")
                self.assertEqual(how, programs.SOLVED)

    def carry_a_cube(self, name, solvers, tolerance):
        scene = cube(0.5)
        for solver in solvers:
            (found, _, _, how), = self.solve(name, solver, 2000, [scene.records()], [12])
            self.assertLess(boxed.residual(boxed.of_environment(scene.environment()), found), tolerance, f"{name} {solver}")
            self.assertAlmostEqual(found[::3].sum(), 1.0, delta=tolerance)  # mass times speed
            self.assertAlmostEqual(found[1::3].sum(), -0.05, delta=tolerance)
            self.assertEqual(how, programs.SOLVED)

    def test_bullet_on_matrices(self):
        self.find_known_answers("Bullet f64", ["dantzig", "pgs"])

    def test_dart_on_matrices(self):
        self.find_known_answers("DART", ["dantzig", "pgs"])

    def test_bullet_on_bodies(self):
        self.carry_a_cube("Bullet f64", ["si"], 1e-9)

    def test_ode_on_bodies(self):
        self.carry_a_cube("ODE", ["step", "quick"], 1e-6)  # its cfm of 1e-10 is on the diagonal, divided by the step


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
