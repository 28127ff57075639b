#!/usr/bin/env python3
"""Runs the package's tests with pytest; without pytest or NumPy says so and exits with 77, which means skipped. It
runs the quick ones of the tests that wait for Warp's compiler: `pytest python/tests`, or -m "" here, has all.
"""

import pathlib
import sys

try:
    import numpy  # noqa: F401
    import pytest
except ImportError as error:
    print(f"the Python package is NOT tested: {error}; pip install numpy pytest")
    sys.exit(77)

if __name__ == "__main__":  # a test's worker process imports this file
    folder = str(pathlib.Path(__file__).parent)
    options = ["-q", "-rs", "--durations=20", "--durations-min=2", "-p", "no:cacheprovider", "-m", "quick or not warp"]
    sys.exit(pytest.main([*options, folder, *sys.argv[1:]]))
