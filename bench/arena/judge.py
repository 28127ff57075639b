"""The judge of the arena: tools/check_law.py, and the rounding that it allows beyond a solver's goal."""

import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2] / "tools"))

from check_law import BOX, BOX_FRICTION, FREE, FRICTION, SEMIDEFINITE, UNILATERAL, law_of, residuals  # noqa: E402, F401

SLACK = 1.02  # solvers add in another order than the judge
