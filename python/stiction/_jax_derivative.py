"""Derivatives of `stiction.jax.solve`: how reactions and motion follow changes of a problem. They are written in JAX's own
operations. So JAX can transpose them, batch them and differentiate them again.

The form is that of the natural map (docs/math/derivative.md). Take the coordinates x = S^-1 lambda, y = S w of unit cones, with
S = diag(mu) on tangential rows. There a solution has

    a x = P(z),    z = a x - y - s e

P is the projection, a any weight of the cone, e its normal row; s = 0 (convex) or norm(y_t) (coulomb). Differentiated at
fixed a, with T = I + e (y_t / norm(y_t))' for Coulomb's law and I otherwise,

    (I - P' + P' T S B S / a) dx = -P' T (dS w + S (dbeta + B dS x)) / a,    B = A + diag R

and dlambda = S dx + dS x, dw = B dlambda + dbeta, dbeta = dA lambda + dR lambda + db.
"""

import jax
import jax.numpy as jnp
import numpy as np

from ._layout import KINDS

#: A cone this close to another mode, over max |b|, is taken to be in that of the smaller reaction, or to stick.
_TIE = 1e-6


def _rows_by_shape(kinds, dims):
    """Rows of all cones of one kind and size, (cones, rows), by (kind, rows)."""
    begins = np.cumsum(dims) - dims
    names = {number: name for name, number in KINDS.items()}
    return {(names[int(kind)], int(dim)): begins[(kinds == kind) & (dims == dim)][:, None] + np.arange(dim)
            for kind, dim in {(int(kind), int(dim)) for kind, dim in zip(kinds, dims)}}


def _norm(v):
    """Norm along the last axis, and the unit vector; both 0, with derivatives 0, where v is 0."""
    square = jnp.sum(v * v, -1, keepdims=True)
    is_zero = square == 0
    norm = jnp.where(is_zero, 0, jnp.sqrt(jnp.where(is_zero, 1, square)))
    return norm[..., 0], jnp.where(is_zero, 0, v / jnp.where(is_zero, 1, norm))


def _friction_blocks(law, z, y, has_friction, tie):
    """P' and P' T of friction cones; z without Coulomb's term. Shapes (..., rows), blocks (..., rows, rows)."""
    rows = z.shape[-1]
    speed, along = _norm(y[..., 1:])
    normal = z[..., 0] - (speed if law == "coulomb" else 0)
    length, u = _norm(jnp.where(has_friction, z[..., 1:], 0))
    eye = jnp.eye(rows, dtype=z.dtype)
    on = jnp.concatenate([jnp.ones_like(normal)[..., None], has_friction.astype(z.dtype)], -1)
    sticking = eye * on[..., None]
    # The projection's derivative where it meets the boundary (docs/math/cones.md).
    share = jnp.where(length > 0, (normal + length) / 2 / jnp.where(length > 0, length, 1), 0)
    across = jnp.eye(rows - 1, dtype=z.dtype) * has_friction[..., None] - u[..., :, None] * u[..., None, :]
    tangential = u[..., :, None] * u[..., None, :] / 2 + share[..., None, None] * across
    top = jnp.concatenate([jnp.full_like(normal, 0.5)[..., None], u / 2], -1)
    sliding = jnp.concatenate([top[..., None, :], jnp.concatenate([u[..., :, None] / 2, tangential], -1)], -2)
    is_open = (normal + length <= tie)[..., None, None]
    sticks = (length - normal <= tie)[..., None, None]
    projection = jnp.where(is_open, 0, jnp.where(sticks, sticking, sliding))
    if law != "coulomb":
        return projection, projection
    shift = jnp.concatenate([jnp.zeros_like(normal)[..., None], along], -1)
    return projection, projection + projection[..., :, :1] * shift[..., None, :]


def _single_rows(kind, z, a, lo, hi, tie):
    """P' of single rows, and the parts of a dlo and a dhi in a dx."""
    one, zero = jnp.ones_like(z), jnp.zeros_like(z)
    if kind == "free":
        return one, zero, zero
    if kind == "unilateral":
        return jnp.where(z > tie, one, zero), zero, zero
    is_point = lo == hi
    at_lo = (z - a * lo < -tie) | (is_point & (z - a * lo <= tie))
    at_hi = ~at_lo & ((a * hi - z < -tie) | is_point)
    return jnp.where(at_lo | at_hi, zero, one), at_lo.astype(z.dtype), at_hi.astype(z.dtype)


def refuse(kinds):
    """Raises ValueError for kinds of cones that have no derivatives."""
    for kind in ("box_friction", "semidefinite"):
        if (np.asarray(kinds) == KINDS[kind]).any():
            raise ValueError(f"cones: {kind} has no derivatives; expected friction, unilateral, box or free where "
                             "derivatives are taken")


def tangents(kinds, dims, law, numbers, changes, lambda_, w, is_solved):
    """Changes of lambda_ and w that follow changes of A, b, mu, R, lo and hi, linear in those. Zeros where an environment
    was not solved, or where its reactions are not determined. Leading axes are environments.
    """
    # A product with 0 is not 0 where a number is not finite.
    A, b, mu, R, lo, hi, lambda_, w = (
        jnp.where(is_solved[(..., *[None] * (x.ndim - is_solved.ndim))], x, 0) for x in (*numbers, lambda_, w))
    dA, db, dmu, dR, dlo, dhi = changes
    n = b.shape[-1]
    if n == 0:
        return db, db
    refuse(kinds)
    groups = _rows_by_shape(kinds, dims)
    tangential = np.zeros(n, bool)
    for (kind, _), rows in groups.items():
        if kind == "friction":
            tangential[rows[:, 1:]] = True
    S, dS = jnp.where(tangential, mu, 1), jnp.where(tangential & (mu > 0), dmu, 0)
    x = jnp.where(S > 0, lambda_ / jnp.where(S > 0, S, 1), 0)
    y = S * w
    eye = jnp.eye(n, dtype=A.dtype)
    B = A + R[..., None] * eye
    diagonal = jax.lax.stop_gradient(S * S * jnp.diagonal(B, axis1=-2, axis2=-1))
    tie = _TIE * jax.lax.stop_gradient(jnp.max(jnp.abs(b), -1, keepdims=True, initial=0))
    a = jnp.ones_like(b)
    projection = turned = jnp.zeros_like(A)
    at_lo = at_hi = jnp.zeros_like(b)
    for (kind, dim), rows in groups.items():
        weight = jnp.mean(diagonal[..., rows], -1, keepdims=True)
        weight = jnp.where(weight > 0, weight, 1)
        a = a.at[..., rows].set(jnp.broadcast_to(weight, b.shape[:-1] + rows.shape))
        z = a[..., rows] * x[..., rows] - y[..., rows]
        if kind == "friction":
            block, both = _friction_blocks(law, z, y[..., rows], S[..., rows[:, 1:]] > 0, tie)
        else:
            flat, (lower, upper) = rows[:, 0], (bound[..., rows] for bound in (lo, hi))
            moves, by_lo, by_hi = _single_rows(kind, z, a[..., rows], lower, upper, tie[..., None])
            block = both = moves[..., None]
            at_lo, at_hi = at_lo.at[..., flat].set(by_lo[..., 0]), at_hi.at[..., flat].set(by_hi[..., 0])
        where = (..., rows[:, :, None], rows[:, None, :])
        projection, turned = projection.at[where].set(block), turned.at[where].set(both)
    by_motion = turned / a[..., None]
    K = eye - projection + by_motion @ (S[..., :, None] * B * S[..., None, :])
    # A pivot of rounding alone says that reactions are not determined.
    factor = jax.scipy.linalg.lu_factor(jax.lax.stop_gradient(jnp.where(jnp.isfinite(K), K, 0)))[0]
    pivots = jnp.abs(jnp.diagonal(factor, axis1=-2, axis2=-1))
    sound = is_solved & jnp.all(pivots > 16 * jnp.finfo(A.dtype).eps, -1) & jnp.all(jnp.isfinite(K), (-2, -1))
    K = jnp.where(sound[..., None, None], K, eye)
    times = lambda matrix, vector: (matrix @ vector[..., None])[..., 0]  # noqa: E731
    dbeta = times(dA, lambda_) + dR * lambda_ + db
    right = at_lo * dlo + at_hi * dhi - times(by_motion, dS * w + S * (dbeta + times(B, dS * x)))
    dx = jnp.linalg.solve(K, jnp.where(sound[..., None], right, 0)[..., None])[..., 0]
    dlambda = S * dx + dS * x
    dw = times(B, dlambda) + dbeta
    return jnp.where(sound[..., None], dlambda, 0), jnp.where(sound[..., None], dw, 0)
