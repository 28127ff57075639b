#!/usr/bin/env python3
"""The recordings in the repository.

Run as a program it exits with 77 (skipped) when numpy, h5py or mujoco is missing, and says which.
"""
import sys
import unittest

try:
    from recordings import ROOT, check_law
except unittest.SkipTest as missing:
    if __name__ == "__main__":
        print(missing)
        sys.exit(77)
    raise

import h5py  # noqa: E402


class Committed(unittest.TestCase):
    def test_the_recordings_in_the_repository_are_what_their_page_promises(self):
        files = sorted((ROOT / "examples" / "data").glob("*.h5"))
        self.assertLess(sum(f.stat().st_size for f in files), 6e6)
        count = 0
        for path in files:
            with h5py.File(path) as file:
                worst = check_law.residuals(file, file["lambda_ref"][:])
            self.assertLess(worst.max(), 1e-12, path.name)
            count += len(worst)
        self.assertGreaterEqual(count, 256)


if __name__ == "__main__":
    unittest.main(verbosity=2)  # says why a test is skipped
