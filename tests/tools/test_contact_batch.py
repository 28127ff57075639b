#!/usr/bin/env python3
"""The residual of tools/contact_batch.py, by hand and by the shared judge, and the recordings in the repository.

Run as a program it exits with 77 (skipped) when numpy, h5py or mujoco is missing, and says which.
"""
import os
import sys
import unittest
from pathlib import Path

try:
    from recordings import ROOT, arrays, contact_batch, environment, load, system_of
except unittest.SkipTest as missing:
    if __name__ == "__main__":
        print(missing)
        sys.exit(77)
    raise

import numpy as np  # noqa: E402

SHARED = Path(os.environ.get("STICTION_SHARED_DIR", ROOT.parent / "shared"))


class Residual(unittest.TestCase):
    def one_cone(self, kind, param, b):
        n = len(b)
        zero, one = np.zeros(n), np.eye(n)
        return contact_batch.System(cone_kind=np.array([kind], np.uint8), cone_rows=np.array([n]), row_param=np.array(param),
                               A=2 * one, b=np.array(b), R=zero, J=one, M=one, v_free=zero, row_target=zero,
                               lambda_ref=zero, v_ref=zero)

    def test_hand_made_cones_have_hand_made_residuals(self):
        # a unilateral row pushed shut: w = 2 * 0 - 3, x - P(x + 1.5) = -1.5, times 2, over max|b| = 3
        pushed, pulled = (self.one_cone(contact_batch.UNILATERAL, [0.0], [b]) for b in (-3.0, 3.0))
        self.assertAlmostEqual(contact_batch.natural_residual(pushed, np.zeros(1)), 1)
        self.assertAlmostEqual(contact_batch.natural_residual(pushed, np.ones(1)), 1 / 3)
        self.assertEqual(contact_batch.natural_residual(pulled, np.zeros(1)), 0)
        # a box of half-width 0.5 cannot reach w = 0 and stops at its bound
        box = self.one_cone(contact_batch.BOX, [0.5], [-3.0])
        self.assertEqual(contact_batch.natural_residual(box, np.array([0.5])), 0)
        self.assertAlmostEqual(contact_batch.natural_residual(box, np.zeros(1)), 1 / 3)
        free = self.one_cone(contact_batch.FREE, [0.0], [4.0])
        self.assertAlmostEqual(contact_batch.natural_residual(free, np.array([-1.0])), 0.5)

    def test_force_along_an_axis_without_friction_is_an_error(self):
        cone = self.one_cone(contact_batch.FRICTION, [0.0, 0.5, 0.0], [-2.0, 0.0, 0.0])
        self.assertEqual(contact_batch.natural_residual(cone, np.array([1.0, 0.0, 0.0])), 0)
        # 0.25 on the idle axis: the rest of the cone is still at its solution, so the residual is 0.25 * 2 / 2
        self.assertAlmostEqual(contact_batch.natural_residual(cone, np.array([1.0, 0.0, 0.25])), 0.25)

    def test_projection_onto_the_cone_covers_its_three_regions(self):
        np.testing.assert_array_equal(contact_batch.project_cone(np.array([5.0, 3.0, 4.0])), [5, 3, 4])
        np.testing.assert_array_equal(contact_batch.project_cone(np.array([-5.0, 3.0, 4.0])), [0, 0, 0])
        np.testing.assert_allclose(contact_batch.project_cone(np.array([1.0, 3.0, 4.0])), [3, 1.8, 2.4], rtol=1e-15)

    def test_the_shared_judge_gives_the_same_number(self):
        judge = SHARED / "tools" / "check_solution.py"
        if not judge.exists():
            self.skipTest(f"no judge at {judge}; set STICTION_SHARED_DIR")
        file = arrays(ROOT / "examples" / "data" / "hand_cube.h5")
        blurred, first = file["lambda_ref"] * 0.99, file["env_row_ptr"]
        theirs = load(judge).residuals(file, blurred, "convex")
        for index in range(0, len(theirs), 8):
            force = blurred[first[index]:first[index + 1]]
            ours = contact_batch.natural_residual(system_of(environment(file, index)), force)
            self.assertAlmostEqual(ours / theirs[index], 1, places=9)


class Committed(unittest.TestCase):
    def test_the_recordings_in_the_repository_are_what_their_page_promises(self):
        files = sorted((ROOT / "examples" / "data").glob("*.h5"))
        self.assertLess(sum(f.stat().st_size for f in files), 6e6)
        count = 0
        for path in files:
            file = arrays(path)
            environments = len(file["env_row_ptr"]) - 1
            for index in range(environments):
                system = system_of(environment(file, index))
                self.assertLess(contact_batch.natural_residual(system, system.lambda_ref), 1e-12, f"{path.name} {index}")
            count += environments
        self.assertGreaterEqual(count, 256)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
