"""Host side of `stiction.jax`: solves, and derivatives that the library computes. Numbers are those of
`stiction.jax.solve`, A (..., n, n) and b, mu, R, lo, hi (..., n); leading axes are environments.
"""

import functools
import typing

import numpy as np

from ..core.arrays import STATUS_DTYPE
from ..core.batch import Batch
from ..core.derivative import Derivative
from ..core.solver import Solver


class How(typing.NamedTuple):
    """Options of a solve besides numbers."""

    cones: str | tuple
    law: str
    solver: str
    tolerance: float
    max_iterations: int
    kappa: float
    allow_ffi: bool


@functools.lru_cache(maxsize=64)
def _solver(solver, tolerance, max_iterations, stall_window=None):
    stall = {} if stall_window is None else {"stall_window": stall_window}
    return Solver(solver=solver, tolerance=tolerance, max_iterations=max_iterations, **stall)


def _flat(lead, dtype, *arrays):
    """With one axis of environments in front, in memory that a batch can read."""
    envs = int(np.prod(lead, dtype=int))
    return [np.ascontiguousarray(np.asarray(x), dtype).reshape((envs, *np.shape(x)[len(lead):])) for x in arrays]


def _batch(how, numbers):
    """(batch, leading axes)"""
    lead = np.shape(numbers[1])[:-1]
    A, b, mu, R, lo, hi = _flat(lead, np.asarray(numbers[0]).dtype, *numbers)
    cones = how.cones if isinstance(how.cones, str) else list(how.cones)
    return Batch.from_delassus(A, b, mu=mu, R=R, lo=lo, hi=hi, cones=cones, law=how.law), lead


def _shaped(lead, arrays):
    return tuple(array.reshape(lead + array.shape[1:]) for array in arrays)


def _gradients(lead, found, *more):
    return _shaped(lead, [getattr(found, name) for name in ("A", "b", "mu", "R", "lo", "hi", *more)])


def _answer(lead, solution):
    records = solution.status.view(np.uint8).reshape(len(solution), STATUS_DTYPE.itemsize)
    return _shaped(lead, (solution.lambda_, solution.w, records))


def solve(how, *numbers):
    """lambda_, w and records."""
    batch, lead = _batch(how, numbers)
    return _answer(lead, _solver(how.solver, how.tolerance, how.max_iterations).solve(batch))


def relaxed_vjp(how, *arguments):
    """Derivatives by the six numbers of the relaxed problem near lambda_. arguments: the numbers, lambda_, records, and
    derivatives of a loss by lambda_ and w.
    """
    batch, lead = _batch(how, arguments[:6])
    lambda_, by_lambda, by_w = _flat(lead, batch.dtype, arguments[6], *arguments[8:])
    records, = _flat(lead, np.uint8, arguments[7])
    found = Derivative(kappa=how.kappa).vjp(batch, lambda_, lambda_=by_lambda, w=by_w,
                                            status=records.view(STATUS_DTYPE).reshape(-1))
    return _gradients(lead, found)


def sweep(how, *arguments):
    """lambda_, w and records of max_iterations sweeps, converged or not. arguments: the numbers, and reactions where
    the sweeps begin.
    """
    batch, lead = _batch(how, arguments[:6])
    start, = _flat(lead, batch.dtype, arguments[6])
    return _answer(lead, _solver(how.solver, 0.0, how.max_iterations, 0).solve(batch, warm_start=start))


def sweep_vjp(how, *arguments):
    """Derivatives by the six numbers, and by the beginning, of those sweeps. arguments: those of sweep(), and
    derivatives of a loss by lambda_ and w.
    """
    batch, lead = _batch(how, arguments[:6])
    start, by_lambda, by_w = _flat(lead, batch.dtype, *arguments[6:])
    found = Derivative().unrolled_vjp(batch, how.max_iterations, warm_start=start, lambda_=by_lambda, w=by_w)
    return _gradients(lead, found, "warm_start")
