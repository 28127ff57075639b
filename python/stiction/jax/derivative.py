"""Derivatives of `stiction.jax.solve`: how reactions and motion follow changes of a problem. They are written in JAX's own
operations. JAX can hence transpose them, batch them and differentiate them again.

They are the linear system of the modes (docs/math/derivative.md): with B = A + diag R and dbeta = dA lambda + dR lambda + db

    dlambda = E z + e,    dw = B dlambda + dbeta,    (F' B E + D) z = -F' (dbeta + B e) - c

Here each cone has as many unknowns z as rows, so that shapes do not depend on modes. Unknowns that its mode does not have
stand alone, and are zero.
"""

import jax
import jax.numpy as jnp
import numpy as np

from ..core.layout import KINDS

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


def _friction_sides(law, lambda_, w, mu, dmu, diagonal, a, tie, largest):
    """E, F, D, e and c of friction cones: lambda_, w and diagonal (..., rows), mu and dmu (..., rows - 1)."""
    dtype, on = w.dtype, mu > 0
    one = jnp.ones_like(w[..., :1])
    S = jnp.concatenate([one, jnp.where(on, mu, 0)], -1)
    x_n, x_t = lambda_[..., 0], jnp.where(on, lambda_[..., 1:] / jnp.where(on, mu, 1), 0)
    y_t = S[..., 1:] * w[..., 1:]
    speed, _ = _norm(y_t)
    length, u = _norm(a[..., None] * x_t - y_t)
    is_open = a * x_n - w[..., 0] - (speed if law == "coulomb" else 0) + length <= tie
    # Distances from both ends of sliding, each relative to its largest: they do not vanish with mu, as a x - y does.
    used, steepest = _norm(x_t)[0], jnp.max(S[..., 1:], -1, initial=0)
    room = jnp.where(x_n > 0, (x_n - used) / jnp.where(x_n > 0, x_n, 1), 1)
    sticks = ~is_open & (speed <= jnp.where(steepest > 0, steepest, 1) * largest * (jnp.maximum(room, 0) + _TIE))
    slides = ~is_open & ~sticks
    # Sliding: x_t = -d x_n, and the part across d turns.
    d = jnp.where(slides[..., None], -u, 0)
    across = jnp.eye(mu.shape[-1], dtype=dtype) * on[..., None] - d[..., :, None] * d[..., None, :]
    turned = jnp.where(slides[..., None, None], across, 0)
    along = -d[..., :, None]
    corner = jnp.where(is_open, 0, 1).astype(dtype)[..., None, None]
    stuck = jnp.where(sticks[..., None, None], jnp.eye(mu.shape[-1], dtype=dtype) * on[..., None], 0)
    right = S[..., 1:, None] * turned + stuck  # that of sticking rows is in units of reactions: mu is not squared there
    E = jnp.concatenate([jnp.concatenate([corner, jnp.zeros_like(along).swapaxes(-1, -2)], -1),
                         jnp.concatenate([S[..., 1:, None] * along, right], -1)], -2)
    test = S[..., 1:, None] * along if law == "convex" else jnp.zeros_like(along)
    F = jnp.concatenate([jnp.concatenate([corner, jnp.zeros_like(along).swapaxes(-1, -2)], -1),
                         jnp.concatenate([test, right], -1)], -2)
    grip = jnp.where(slides & (x_n > 0), speed / jnp.where(x_n > 0, x_n, 1), 0)
    alone = jnp.eye(mu.shape[-1], dtype=dtype) - turned - stuck
    weight = grip + jnp.max(S[..., 1:] ** 2 * diagonal[..., 1:], -1, initial=0)  # of the size of others in those rows
    weight = jnp.where(slides & (weight > 0), weight, 1)
    top = jnp.concatenate([1 - corner, jnp.zeros_like(along).swapaxes(-1, -2)], -1)
    below = grip[..., None, None] * turned + jax.lax.stop_gradient(weight)[..., None, None] * alone
    D = jnp.concatenate([top, jnp.concatenate([jnp.zeros_like(along), below], -1)], -2)
    moves = jnp.where(slides[..., None] & on, dmu, 0)
    zero = jnp.zeros_like(w[..., :1])
    e = jnp.concatenate([zero, moves * x_t], -1)
    felt = moves * w[..., 1:]
    first = jnp.sum(-d * felt, -1, keepdims=True) if law == "convex" else zero
    c = jnp.concatenate([first, (turned @ felt[..., None])[..., 0]], -1)
    return E, F, D, e, c


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


def _scaled(G):
    """G with rows, then columns, divided by powers of two near their largest entries; those divisors' inverses. The
    scale that a pivot is small against then does not depend on mu, nor on other units of rows."""
    def inverse(largest):
        return jnp.where(largest > 0, jnp.ldexp(jnp.ones_like(largest), -jnp.frexp(largest)[1]), 1)

    known = jax.lax.stop_gradient(G)
    rows = inverse(jnp.max(jnp.abs(known), -1))
    columns = inverse(jnp.max(jnp.abs(known * rows[..., None]), -2))
    return rows[..., None] * G * columns[..., None, :], rows, columns


def _times(matrix, vector):
    return (matrix @ vector[..., None])[..., 0]


class _System:
    """The system of the modes at an answer. is_sound: environments whose motion of reactions it gives."""

    def __init__(self, kinds, dims, law, numbers, dmu, lambda_, w, is_solved):
        # A product with 0 is not 0 where a number is not finite.
        A, b, mu, R, lo, hi, lambda_, w = (
            jnp.where(is_solved[(..., *[None] * (x.ndim - is_solved.ndim))], x, 0) for x in (*numbers, lambda_, w))
        n, dtype = b.shape[-1], A.dtype
        self.lambda_, self.B = lambda_, A + R[..., None] * jnp.eye(n, dtype=dtype)
        largest = jax.lax.stop_gradient(jnp.max(jnp.abs(b), -1, keepdims=True, initial=0))
        tie, diagonal = _TIE * largest, jax.lax.stop_gradient(jnp.diagonal(self.B, axis1=-2, axis2=-1))
        E = F = D = jnp.zeros_like(A)
        self.e = self.c = jnp.zeros_like(b)
        self.at_lo = self.at_hi = jnp.zeros_like(b)
        for (kind, dim), rows in _rows_by_shape(kinds, dims).items():
            S = jnp.concatenate([jnp.ones_like(mu[..., rows[:, :1]]), mu[..., rows[:, 1:]]], -1)
            a = jnp.mean(jax.lax.stop_gradient(S * S) * diagonal[..., rows], -1)
            a = jnp.where(a > 0, a, 1)
            if kind == "friction":
                own = _friction_sides(law, lambda_[..., rows], w[..., rows], mu[..., rows[:, 1:]], dmu[..., rows[:, 1:]],
                                      diagonal[..., rows], a, tie, largest)
                self.e, self.c = (x.at[..., rows].set(y, unique_indices=True) for x, y in zip((self.e, self.c), own[3:]))
                right, left, alone = own[:3]
            else:
                flat, (lower, upper) = rows[:, 0], (bound[..., rows[:, 0]] for bound in (lo, hi))
                z = a * lambda_[..., flat] - w[..., flat]
                moves, by_lo, by_hi = _single_rows(kind, z, a, lower, upper, tie)
                self.at_lo, self.at_hi = self.at_lo.at[..., flat].set(by_lo), self.at_hi.at[..., flat].set(by_hi)
                right = left = moves[..., None, None]
                alone = 1 - right
            where = (..., rows[:, :, None], rows[:, None, :])
            E, F, D = E.at[where].set(right), F.at[where].set(left), D.at[where].set(alone)
        self.E, self.Ft = E, F.swapaxes(-1, -2)
        G = self.Ft @ self.B @ E + D
        is_finite = jnp.all(jnp.isfinite(G), (-2, -1))
        G, self.by_row, self.by_column = _scaled(jnp.where(is_finite[..., None, None], G, jnp.eye(n, dtype=dtype)))
        # A pivot of rounding alone means that reactions are not determined.
        factor = jax.scipy.linalg.lu_factor(jax.lax.stop_gradient(G))[0]
        pivots = jnp.abs(jnp.diagonal(factor, axis1=-2, axis2=-1))
        self.is_sound = is_solved & is_finite & jnp.all(pivots > 16 * jnp.finfo(dtype).eps, -1)
        self.G = jnp.where(self.is_sound[..., None, None], G, jnp.eye(n, dtype=dtype))

    def solve(self, right):
        """z, of a right-hand side; 0 where the environment is not sound."""
        right = jnp.where(self.is_sound[..., None], self.by_row * right, 0)
        return self.by_column * jnp.linalg.solve(self.G, right[..., None])[..., 0]


def is_determined(kinds, dims, law, numbers, lambda_, w, is_solved):
    """Which environments have derivatives that are not zero for want of them."""
    refuse(kinds)
    if numbers[1].shape[-1] == 0:
        return is_solved
    return _System(kinds, dims, law, numbers, jnp.zeros_like(numbers[1]), lambda_, w, is_solved).is_sound


def tangents(kinds, dims, law, numbers, changes, lambda_, w, is_solved):
    """Changes of lambda_ and w that follow changes of A, b, mu, R, lo and hi, linear in those. Zeros where an environment
    was not solved, or where its reactions are not determined. Leading axes are environments.
    """
    dA, db, dmu, dR, dlo, dhi = changes
    if db.shape[-1] == 0:
        return db, db
    refuse(kinds)
    system = _System(kinds, dims, law, numbers, dmu, lambda_, w, is_solved)
    dbeta = _times(dA, system.lambda_) + dR * system.lambda_ + db
    e = system.e + system.at_lo * dlo + system.at_hi * dhi
    z = system.solve(-_times(system.Ft, dbeta + _times(system.B, e)) - system.c)
    dlambda = _times(system.E, z) + e
    dw = _times(system.B, dlambda) + dbeta
    return tuple(jnp.where(system.is_sound[..., None], change, 0) for change in (dlambda, dw))
