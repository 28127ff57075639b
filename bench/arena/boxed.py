"""Boxed friction, the law of physics engines, as their solvers take it.

A normal row has 0 <= x, 0 <= w and x w = 0. A row of friction stays within mu times the reaction of its contact's
normal row. w = 0 inside, w >= 0 at the lower bound, w <= 0 at the upper one, each direction separately. This is not
the cone of contact batches (docs/math/contact_problem.md), neither under Coulomb's law nor under the convex one.
"""

import dataclasses

import numpy as np
from environments import BOX_FRICTION, FRICTION, UNILATERAL

FAR = 1e30  # an infinite bound


@dataclasses.dataclass
class Boxed:
    """w = A x + b; bounds of row i are lo, hi, or -hi and hi times x[findex] where findex >= 0."""

    A: np.ndarray  # (rows, rows)
    b: np.ndarray  # [w]  (rows)
    lo: np.ndarray  # (rows)
    hi: np.ndarray  # (rows); mu where findex >= 0
    findex: np.ndarray  # (rows); -1: the bounds are numbers


def of_environment(environment):
    """Every friction cone boxed. ValueError where there are cones of other kinds than friction and half lines."""
    if not np.isin(environment.kinds, (UNILATERAL, FRICTION, BOX_FRICTION)).all():
        raise ValueError(f"cones of kinds {sorted(set(environment.kinds.tolist()))}: half lines and friction can be boxed")
    normal = np.repeat(environment.cone_offsets[:-1], environment.cone_sizes)
    rubs = normal != np.arange(environment.rows)
    return Boxed(environment.dense(), environment.b, np.where(rubs, -environment.row_param, 0.0),
                 np.where(rubs, environment.row_param, FAR), np.where(rubs, normal, -1))
