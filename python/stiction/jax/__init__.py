"""Contact problems as a JAX function that can be jitted, vmapped and differentiated, as often as one likes.

    lambda_, w, status = stiction.jax.solve(A, b, mu, law="coulomb")

`uses_ffi` says if solves, and derivatives that are the library's, are XLA custom calls on the CPU. A custom call
follows its arguments' sharding by environments: each device solves its own, and nothing is gathered. A host callback
gathers everything unless it is called inside jax.shard_map.
"""

import functools
import math

import jax
import jax.numpy as jnp
import numpy as np

from ..core.arguments import number, whole
from ..core.arrays import STATUS_DTYPE
from ..core.solution import SOLVED
from . import calls
from . import derivative as derivatives
from .calls import uses_ffi  # noqa: F401 - part of the interface
from .host import How


@functools.partial(jax.custom_jvp, nondiff_argnums=(6,))
def _solve(A, b, mu, R, lo, hi, how):
    return calls.run("solve", how, A, b, mu, R, lo, hi)


@_solve.defjvp
def _(how, numbers, changes):
    lambda_, w, records = _solve(*numbers, how)
    kinds, dims = calls.cones_of(how.cones, numbers[1].shape[-1])
    moved = derivatives.tangents(kinds, dims, how.law, numbers, changes, lambda_, w, _is_solved(records))
    return (lambda_, w, records), (*moved, np.zeros(records.shape, jax.dtypes.float0))


@functools.partial(jax.custom_vjp, nondiff_argnums=(6,))
def _solve_relaxed(A, b, mu, R, lo, hi, how):
    """As _solve; its derivatives are those of the relaxed problem."""
    return _solve(A, b, mu, R, lo, hi, how)


def _keep_relaxed(*arguments):
    numbers, how = arguments[:6], arguments[6]
    lambda_, w, records = _solve(*numbers, how)
    return (lambda_, w, records), (*numbers, lambda_, records)


@functools.partial(jax.custom_vjp, nondiff_argnums=(7,))
def _sweep(A, b, mu, R, lo, hi, start, how):
    """max_iterations sweeps from reactions `start`, and their derivatives."""
    return calls.run("sweep", how, A, b, mu, R, lo, hi, start)


def _keep_sweep(*arguments):
    return _sweep(*arguments), arguments[:7]


def _pull(name, how, kept, by):
    """Derivatives by the library, in reverse."""
    derivatives.refuse(calls.cones_of(how.cones, kept[1].shape[-1])[0])
    return calls.run(name, how, *kept, *by[:2])


_solve_relaxed.defvjp(_keep_relaxed, functools.partial(_pull, "relaxed_vjp"))
_sweep.defvjp(_keep_sweep, functools.partial(_pull, "sweep_vjp"))


@functools.partial(jax.jit, static_argnames=("cones", "law", "solver", "tolerance", "max_iterations",
                                             "allow_ffi", "kappa", "derivative"))
def solve(A, b, mu=0.0, R=0.0, lo=0.0, hi=0.0, *, cones="friction", law="convex", solver="auto", tolerance=1e-4,
          max_iterations=1000, allow_ffi=True, kappa=0.0, derivative="implicit", warm_start=None):
    """Reactions, residual motion and status of contact problems.

    A (..., n, n), b (..., n), mu, R, lo, hi like b or numbers; float32, or float64 with jax_enable_x64. Leading axes
    are environments, those of vmap too, and broadcast: one A may go with many b. cones: a kind's name or a tuple of
    names and (name, rows) pairs, together all rows, the same for all. Returns lambda_ and w, shaped like b, and status
    as bytes uint8 (..., 32), which `status(...)` names.
    allow_ffi False: the host callback in any case.

    lambda_ and w have derivatives by all numbers, forward and reverse, of any order (docs/math/derivative.md). They are
    those of the solution, not of the iterations, and err by as much as the solution does: solve to 1e-6 or less. An
    environment that was not solved has derivatives of 0, and so has one whose reactions are not determined: give R.
    `has_derivative` says which.

    kappa > 0 takes the derivatives of the relaxed problem, so that open contacts pass some on (stiction.Derivative).
    The results do not change. derivative="unrolled" takes those of exactly max_iterations sweeps of solver="pgs" with
    tolerance=0, converged or not (Derivative.unrolled_vjp). They begin at reactions warm_start, like b (None: 0),
    which have derivatives, too. Both are in reverse and once, and the library's: so are their bits.
    """
    A, b = jnp.asarray(A), jnp.asarray(b)
    if A.dtype not in (jnp.float32, jnp.float64):
        raise TypeError(f"A: expected float32 or float64, got {A.dtype}")
    if jnp.iscomplexobj(b):
        raise TypeError(f"b: expected real numbers, got {b.dtype}")
    A, b = _over_environments(A, b)
    tolerance, kappa = _not_negative("tolerance", tolerance), _not_negative("kappa", kappa)
    max_iterations = whole("max_iterations", max_iterations)
    if max_iterations < 0:
        raise ValueError(f"max_iterations: expected an integer of at least 0, got {max_iterations}")
    _check_derivative(derivative, solver, tolerance, kappa, warm_start)
    wide = [jnp.broadcast_to(jnp.asarray(x, A.dtype), b.shape) for x in (mu, R, lo, hi)]
    numbers = A, b.astype(A.dtype), *wide
    how = How(cones, law, solver, tolerance, max_iterations, kappa, allow_ffi)
    if derivative == "unrolled":
        start = jnp.asarray(0 if warm_start is None else warm_start, A.dtype)
        return _sweep(*numbers, jnp.broadcast_to(start, b.shape), how)
    return _solve_relaxed(*numbers, how) if kappa else _solve(*numbers, how)


@functools.partial(jax.jit, static_argnames=("cones", "law"))
def has_derivative(answer, A, b, mu=0.0, R=0.0, lo=0.0, hi=0.0, *, cones="friction", law="convex"):
    """Which environments have implicit derivatives, bool (...): those that were solved and whose reactions are determined.
    Derivatives of others are 0 for want of any. answer: (lambda_, w, status) of `solve` with these arguments.
    """
    lambda_, w, records = answer
    A, b = _over_environments(jnp.asarray(A), jnp.asarray(b))
    numbers = (A, *(jnp.broadcast_to(jnp.asarray(x, A.dtype), b.shape) for x in (b, mu, R, lo, hi)))
    kinds, dims = calls.cones_of(cones, b.shape[-1])
    return derivatives.is_determined(kinds, dims, law, numbers, lambda_, w, _is_solved(records))


def _is_solved(records):
    return records[..., STATUS_DTYPE.fields["code"][1]] == SOLVED


def _over_environments(A, b):
    """Both with the leading axes that they have together, as NumPy broadcasts."""
    rows = b.shape[-1:]
    if not rows:
        raise ValueError("b: expected (..., rows), got a number")
    if A.shape[-2:] != rows * 2:
        raise ValueError(f"A: expected (..., {rows[0]}, {rows[0]}), got {A.shape}")
    try:
        lead = np.broadcast_shapes(A.shape[:-2], b.shape[:-1])
    except ValueError:
        raise ValueError(f"A: expected environments that broadcast with those of b {b.shape}, got {A.shape}") from None
    return jnp.broadcast_to(A, lead + rows * 2), jnp.broadcast_to(b, lead + rows)


def _not_negative(name, value):
    value = number(name, value)
    if not 0 <= value < math.inf:
        raise ValueError(f"{name}: expected a finite number of at least 0, got {value}")
    return value


def _check_derivative(derivative, solver, tolerance, kappa, warm_start):
    if derivative not in ("implicit", "unrolled"):
        raise ValueError(f"derivative: expected 'implicit' or 'unrolled', got {derivative!r}")
    if derivative == "unrolled" and (solver != "pgs" or tolerance != 0 or kappa != 0):
        raise ValueError("derivative: 'unrolled' is that of max_iterations sweeps as they run: expected solver='pgs', "
                         f"tolerance=0 and kappa=0, got {solver!r}, {tolerance} and {kappa}")
    if derivative == "implicit" and warm_start is not None:
        raise ValueError("warm_start: expected None where derivative is 'implicit', got an array: the solution does "
                         "not depend on where a solve begins")


def status(records):
    """The records of `solve` as NumPy's: code, flags, iterations, residual, residual_abs, solver."""
    return np.asarray(records).view(STATUS_DTYPE).reshape(records.shape[:-1])
