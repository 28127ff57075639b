"""Boxed friction, the law of physics engines: what solves it, and the same problems as complementarity problems.

A normal row has 0 <= x, 0 <= w and x w = 0. A row of friction stays within mu times the reaction of its contact's
normal row. w = 0 inside, w >= 0 at the lower bound, w <= 0 at the upper one, each direction separately. That is not
the cone of contact batches (docs/math/contact_problem.md), neither under Coulomb's law nor under the convex one.
"""

import dataclasses

import numpy as np
from environments import BOX_FRICTION, FRICTION, UNILATERAL, Environment

FAR = 1e30  # a bound that is none


@dataclasses.dataclass
class Boxed:
    """w = A x + b; bounds of row i are lo, hi, or -hi and hi times x[findex] where findex >= 0."""

    A: np.ndarray  # (rows, rows)
    b: np.ndarray  # [w]  (rows)
    lo: np.ndarray  # (rows)
    hi: np.ndarray  # (rows); mu where findex >= 0
    findex: np.ndarray  # (rows); -1: the bounds are numbers


def dense(environment):
    """A + diag R."""
    offsets, columns, values = environment.with_compliance()
    matrix = np.zeros((environment.rows,) * 2)
    np.add.at(matrix, (np.repeat(np.arange(environment.rows), np.diff(offsets)), columns), values)
    return matrix


def of_environment(environment):
    """Every friction cone boxed. ValueError where there are cones of other kinds than friction and half lines."""
    if not np.isin(environment.kinds, (UNILATERAL, FRICTION, BOX_FRICTION)).all():
        raise ValueError(f"cones of kinds {sorted(set(environment.kinds.tolist()))}: half lines and friction can be boxed")
    normal = np.repeat(environment.cone_offsets[:-1], environment.cone_sizes)
    rubs = normal != np.arange(environment.rows)
    return Boxed(dense(environment), environment.b, np.where(rubs, -environment.row_param, 0.0),
                 np.where(rubs, environment.row_param, FAR), np.where(rubs, normal, -1))


def residual(problem, x):
    """The natural map's largest row, in units of w, over max|b|: x less the projection of x - w / a on the bounds, times a. a is
    the row's diagonal, or its largest entry where that is not positive."""
    if not np.isfinite(x).all():
        return np.inf
    motion = problem.A @ x + problem.b
    diagonal, largest = np.diag(problem.A), np.abs(problem.A).max(axis=1)
    scale = np.where(diagonal > 0, diagonal, np.where(largest > 0, largest, 1.0))
    rubs = problem.findex >= 0
    bound = problem.hi * np.maximum(x[problem.findex], 0)
    low, high = np.where(rubs, -bound, problem.lo), np.where(rubs, bound, problem.hi)
    return float(np.abs((x - np.clip(x - motion / scale, low, high)) * scale).max() / max(np.abs(problem.b).max(), 1e-300))


def in_boxes(environment):
    """The contacts as stiction has boxed friction."""
    return dataclasses.replace(environment, kinds=np.where(environment.kinds == FRICTION, BOX_FRICTION, environment.kinds))


def lcp(matrix, b):
    """An environment of half lines with this matrix; exact zeros beside the diagonal are not stored."""
    rows = len(b)
    stored = (matrix != 0) | np.eye(rows, dtype=bool)
    return Environment(np.concatenate(([0], np.cumsum(stored.sum(axis=1)))), np.nonzero(stored)[1], matrix[stored], b,
                       np.zeros(rows), np.full(rows, UNILATERAL), np.arange(rows + 1), np.zeros(rows))


def plain(environment):
    """An LCP as engines take it."""
    rows = environment.rows
    return Boxed(dense(environment), environment.b, np.zeros(rows), np.full(rows, FAR), np.full(rows, -1))


def as_lcp(problem):
    """(environment of half lines, E) with the same solutions, x = E z.

    z = (x_n, p, v). Friction is p - mu x_n, p >= 0 counts from the lower bound, and v >= 0 is what holds it at the
    upper one. So 0 <= p, w + v >= 0 and 0 <= v, 2 mu x_n - p >= 0. Not symmetric, and zero on the diagonal of v.
    """
    normal, rubbing = np.flatnonzero(problem.findex < 0), np.flatnonzero(problem.findex >= 0)
    count, rubs = len(normal), len(rubbing)
    limit = np.zeros((rubs, count))
    limit[np.arange(rubs), np.searchsorted(normal, problem.findex[rubbing])] = problem.hi[rubbing]
    back = np.zeros((len(problem.b), count + 2 * rubs))
    back[normal, np.arange(count)] = 1
    back[rubbing, :count] = -limit
    back[rubbing, count + np.arange(rubs)] = 1
    order = np.concatenate((normal, rubbing))
    matrix = np.zeros((count + 2 * rubs,) * 2)
    matrix[:count + rubs] = problem.A[order] @ back
    matrix[count:count + rubs, count + rubs:] = np.eye(rubs)
    matrix[count + rubs:, :count] = 2 * limit
    matrix[count + rubs:, count:count + rubs] = -np.eye(rubs)
    return lcp(matrix, np.concatenate((problem.b[order], np.zeros(rubs)))), back


def edges(environment):
    """The LCP of pyramids of four edges under the convex law (docs/pyramid.md): symmetric, four rows a contact of three."""
    columns = []
    for first, size, kind in zip(environment.cone_offsets, environment.cone_sizes, environment.kinds):
        for row in range(first, first + size) if kind == FRICTION and size > 1 else [first]:
            for sign in (1, -1) if row > first else (0,):
                column = np.zeros(environment.rows)
                column[first] = 1
                column[row] += sign * environment.row_param[row]
                if sign or size == 1:
                    columns.append(column)
    directions = np.array(columns).T
    return lcp(directions.T @ dense(environment) @ directions, directions.T @ environment.b)
