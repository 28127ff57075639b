"""The judge of the arena: the residual of docs/math/residual.md, in NumPy, from the numbers of a contact-batch file.

It shares no code with any solver, nor with `stiction verify`; tests/tools/test_arena.py compares the two.
"""

import numpy as np

FREE, UNILATERAL, BOX, FRICTION, BOX_FRICTION, SEMIDEFINITE = range(6)  # cone_kind of the file
SMALLEST = 1e-300  # that an environment's motion is measured by
SLACK = 1.02  # solvers add in another order than the judge


def law_of(batch):
    law = batch.attrs.get("law", "convex")
    return law.decode() if isinstance(law, bytes) else law


def residuals(batch, reaction, law=None):
    """Relative residual of each environment of the open file; infinite where anything is not finite."""
    rows_of, cones_of = batch["env_row_ptr"][:], batch["env_cone_ptr"][:]
    count = len(rows_of) - 1
    x = np.asarray(reaction, float)
    if x.shape != (rows_of[-1],):
        raise ValueError(f"lambda has shape {x.shape}, the batch has {rows_of[-1]} rows")
    with np.errstate(all="ignore"):
        w, diagonal = motion(batch, x, rows_of)
        cone = cone_residuals(batch, x, w, diagonal, law or law_of(batch))
        worst = np.zeros(count)
        np.maximum.at(worst, np.repeat(np.arange(count), np.diff(cones_of)), np.where(np.isfinite(cone), cone, np.inf))
        size, broken = np.zeros(count), np.zeros(count, bool)
        env = np.repeat(np.arange(count), np.diff(rows_of))
        np.maximum.at(size, env, np.abs(batch["b"][:]))
        np.logical_or.at(broken, env, ~(np.isfinite(x) & np.isfinite(w)))
        return np.where(broken, np.inf, worst / np.maximum(size, SMALLEST))


def motion(batch, x, rows_of):
    """(w, diagonal of A + R): w = (A + diag R) x + b, with the entries as stored; entries of one place add up."""
    row = np.repeat(np.arange(len(x)), np.diff(batch["A/ptr"][:]))
    first = np.repeat(rows_of[:-1], np.diff(rows_of))
    column, value, compliance = batch["A/col"][:] + first[row], batch["A/val"][:], batch["R"][:]
    w = np.bincount(row, value * x[column], len(x)) + compliance * x + batch["b"][:]
    return w, np.bincount(row, value * (row == column), len(x)) + compliance


def cone_residuals(batch, x, w, diagonal, law):
    """norm(r) of every cone; cones of one kind and size are taken together."""
    kinds, offsets, parameter = batch["cone_kind"][:], batch["cone_row_ptr"][:], batch["row_param"][:]
    low = batch["row_lo"][:] if "row_lo" in batch else -parameter
    high = batch["row_hi"][:] if "row_hi" in batch else parameter
    sizes, found = np.diff(offsets), np.zeros(len(kinds))
    for kind, size in {*zip(kinds.tolist(), sizes.tolist())}:
        own = np.flatnonzero((kinds == kind) & (sizes == size))
        rows = offsets[own][:, None] + np.arange(size)
        a = diagonal[rows].mean(axis=1)
        a = np.where(a > 0, a, 1.0)[:, None]
        force, moves = a * x[rows], w[rows]
        if kind == FREE:
            r = moves
        elif kind == UNILATERAL:
            r = force - np.maximum(force - moves, 0)
        elif kind == BOX:
            r = force - np.clip(force - moves, a * low[rows], a * high[rows])
        elif kind == BOX_FRICTION:
            r = boxed(force, moves, parameter[rows][:, 1:])
        elif kind == SEMIDEFINITE:
            r = force - nearest_matrix(force - moves)
        else:
            r = friction(force, moves, parameter[rows][:, 1:], law)
        found[own] = np.sqrt((r * r).sum(axis=1))
    return found


def friction(force, moves, mu, law):
    """r of friction cones. A column more than rows: axes without friction must carry nothing."""
    grips = mu > 0
    x = np.where(grips, force[:, 1:] / np.where(grips, mu, 1.0), 0.0)
    y = np.where(grips, moves[:, 1:] * mu, 0.0)
    shift = np.sqrt((y * y).sum(axis=1)) if law == "coulomb" else 0.0
    x, y = np.column_stack((force[:, 0], x)), np.column_stack((moves[:, 0] + shift, y))
    carried = np.abs(np.where(grips, 0.0, force[:, 1:])).max(axis=1, initial=0.0)
    return np.column_stack((x - nearest(x - y), carried))


def boxed(force, moves, mu):
    """r of boxed friction: each axis between bounds of its own. Axes without friction must carry nothing."""
    grips, normal = mu > 0, force[:, :1]
    x = force[:, 1:] / np.where(grips, mu, 1.0)
    bound = np.maximum(normal, 0)
    along = x - np.where(grips, np.clip(x - mu * moves[:, 1:], -bound, bound), 0.0)
    return np.column_stack((normal - np.maximum(normal - moves[:, :1], 0), along))


def nearest_matrix(z):
    """The nearest positive semidefinite matrix: upper triangles column by column, off-diagonals times sqrt(2)."""
    order = 2 if z.shape[1] == 3 else 3
    column, row = np.tril_indices(order)
    factor = np.where(row == column, 1.0, np.sqrt(2.0))
    whole = np.zeros((len(z), order, order))
    whole[:, row, column] = whole[:, column, row] = np.where(np.isfinite(z), z, 0) / factor
    value, vector = np.linalg.eigh(whole)
    kept = (vector * np.maximum(value, 0)[:, None, :]) @ np.swapaxes(vector, 1, 2)
    return np.where(np.isfinite(z).all(axis=1, keepdims=True), kept[:, row, column] * factor, np.nan)


def nearest(z):
    """The nearest point of the circular unit cone."""
    n, t = z[:, :1], np.sqrt((z[:, 1:] ** 2).sum(axis=1, keepdims=True))
    edge = 0.5 * (n + t) * np.column_stack((np.ones(len(z)), z[:, 1:] / np.where(t > 0, t, 1.0)))
    return np.where(t <= n, z, np.where(t <= -n, 0.0, edge))
