"""Derivatives of solutions by the numbers of their batches."""

from __future__ import annotations

import types

import numpy as np

from .. import _core
from . import streams
from .arguments import number, whole, word
from .arrays import NUMPY, STATUS_DTYPE, as_numpy, look, take
from .batch import Batch
from .solution import Solution, to_host

#: Record of one environment's derivative. 32 bytes.
GRADIENT_DTYPE = np.dtype([("residual", "<f8"), ("forward_residual", "<f8"), ("flags", "<u4"), ("unknowns", "<i4"),
                           ("degenerate", "<i4"), ("reserved", "<u4")])
#: Names of the flags of such a record, by bit.
GRADIENT_FLAGS = tuple(_core.gradient_flag_names())
#: Flags that come with zeros in place of a derivative.
REFUSED = sum(1 << GRADIENT_FLAGS.index(name)
               for name in ("invalid_input", "unconverged", "non_finite", "singular", "over_capacity",
                            "bad_structure"))


class Gradients(types.SimpleNamespace):
    """Arrays by name, and `status`: one record of GRADIENT_DTYPE for each environment, NumPy's. On a GPU the arrays are
    ready in the order of the call's stream. `status` waits for it and copies to the host.
    """

    @property
    def status(self) -> np.ndarray:
        """Records (B,) of GRADIENT_DTYPE."""
        found = self.__dict__["status"]
        if callable(found):
            found = self.__dict__["status"] = found()
        return found

    def flagged(self, name: str) -> np.ndarray:
        """Which environments have that flag of GRADIENT_FLAGS, bool (B,)."""
        return (self.status["flags"] >> GRADIENT_FLAGS.index(name)) & 1 == 1

    @property
    def valid(self) -> np.ndarray:
        """Which environments have a derivative; the others have zeros. bool (B,)"""
        return self.status["flags"] & REFUSED == 0


class Derivative:
    """Differentiates solutions of batches implicitly, by one linear system for each environment
    (docs/math/derivative.md). It has no part in the solve. Bits do not depend on the device.

    device: "cpu", of batches of host memory, whose derivatives are NumPy arrays. Or as for Solver, of batches in that
        device's memory, whose derivatives are arrays of their framework there.
    law: "convex" or "coulomb" instead of the batch's, as the solver has it.
    residual_limit: reactions of a larger relative residual get zeros and the flag "unconverged" [-].
    tie_tolerance: a cone this close to another mode, over max |b|, is counted as degenerate [-].
    max_unknowns: of an environment; a larger one gets zeros and the flag "over_capacity".
    threads: 0: all cores. The bits do not depend on it.
    kappa: above 0: the derivative of the relaxed problem, in which every reaction times its motion is kappa and not 0
        (docs/math/derivative.md#relaxed). Open contacts then pass some on, and nothing jumps where contacts begin. It is
        the derivative of another map, which is closer to the exact one the smaller kappa is [lambda_ w]; of impulses J.

    Give contacts compliance (R > 0): reactions of redundant hard contacts are not determined, and have no derivative.
    """

    def __init__(self, device: str = "cpu", *, law: str | None = None, residual_limit: float = 1e-3,
                 tie_tolerance: float = 1e-6, max_unknowns: int = 1024, threads: int = 0,
                 kappa: float = 0.0):
        self._core = _core.Derivative(str(device), None if law is None else word("law", law),
                                      number("residual_limit", residual_limit), number("tie_tolerance", tie_tolerance),
                                      whole("max_unknowns", max_unknowns), whole("threads", threads),
                                      number("kappa", kappa))
        self.device = self._core.device

    def vjp(self, batch: Batch, solution, *, lambda_=None, w=None, velocities=None, status=None,
            stream=None) -> Gradients:
        """Pulls derivatives of a loss by the solution back to the batch.

        solution: a Solution of this batch, or its reactions alone.
        status: records of how environments were solved, by default those of the Solution. Environments that were not
            solved get zeros. Without records the residual alone decides. On a GPU uint8 (B, 32), in its memory.
        lambda_, w, velocities: derivatives of the loss by each, shaped as in the Solution. One more axis in front
            means several losses at once. None: zeros. velocities is for batches of J and M.
        stream: as for Solver.solve.

        Returns derivatives by A, b, R, mu, lo, hi, or by J, M, v_free, target, R, mu, lo, hi. Arrays of rows are
        shaped as the rows, all others as the batch's arrays. The axis of several losses comes first. Entries of A and
        J are independent; the derivative by M is symmetric.
        """
        self._check(batch)
        at, status = self._answer(batch, solution, status)
        rows = batch.layout.row_shape
        shapes = {"lambda_": rows, "w": rows}
        given = {"lambda_": lambda_, "w": w}
        if batch.form == "jacobian":
            shapes["velocities"], given["velocities"] = batch.dof_shape, velocities
        elif velocities is not None:
            raise ValueError("velocities: expected None for a batch of form 'delassus', which has none")
        cotangents, front = self._sets(batch, given, shapes)
        out = {name: front + shape for name, shape in self._number_shapes(batch).items()}
        call = self._core.vjp_jacobian if batch.form == "jacobian" else self._core.vjp_contacts
        return self._run(call, batch, at, status, cotangents, out, front, stream)

    def jvp(self, batch: Batch, solution, *, A=None, b=None, J=None, M=None, v_free=None, target=None, R=None, mu=None,
            lo=None, hi=None, status=None, stream=None) -> Gradients:
        """Pushes changes of a batch forward: changes of lambda_ and w, and of velocities where it has J and M.
        solution, status, stream: as for vjp.

        A, b, R, mu, lo, hi: changes of a batch of form 'delassus', shaped as the results of vjp. One more axis in front
            means several changes at once. None: zeros.
        J, M, v_free, target, R, mu, lo, hi: the same of a batch of form 'jacobian'. The symmetric part of M counts,
        and the lower triangle of a factor.
        """
        self._check(batch)
        own = {"R": R, "mu": mu, "lo": lo, "hi": hi}
        jacobian, delassus = {"J": J, "M": M, "v_free": v_free, "target": target}, {"A": A, "b": b}
        is_jacobian = batch.form == "jacobian"
        for name, value in (delassus if is_jacobian else jacobian).items():
            if value is not None:
                raise ValueError(f"{name}: expected None for a batch of form {batch.form!r}, which has none")
        at, status = self._answer(batch, solution, status)
        tangents, front = self._sets(batch, own | (jacobian if is_jacobian else delassus), self._number_shapes(batch))
        shapes = {"lambda_": batch.layout.row_shape, "w": batch.layout.row_shape}
        if is_jacobian:
            shapes["velocities"] = batch.dof_shape
        out = {name: front + shape for name, shape in shapes.items()}
        call = self._core.jvp_jacobian if is_jacobian else self._core.jvp_contacts
        return self._run(call, batch, at, status, tangents, out, front, stream)

    def unrolled_vjp(self, batch: Batch, sweeps: int, *, warm_start=None, omega: float = 1.0, lambda_=None, w=None,
                     stream=None) -> Gradients:
        """Pulls derivatives of a loss back through so many sweeps of solver "pgs" as they run, to the batch and to where
        the sweeps began. It is the derivative of a solve with max_iterations=sweeps, tolerance=0 and stall_window=0,
        converged or not (docs/math/derivative.md#unrolled).

        batch: of form 'delassus'. warm_start: reactions shaped as the rows, None: zeros. omega: as for Solver.
        lambda_, w, stream: as for vjp.

        Returns derivatives as vjp does, and by `warm_start`. `lambda_` is the answer of so many sweeps. Sweeps are run
        again in double and kept: 2 (n + sweeps) n doubles an environment of n rows. More rows than max_unknowns get
        zeros and the flag "over_capacity"; "unconverged" is never set.
        """
        self._check(batch)
        if batch.form != "delassus":
            raise ValueError(f"batch: expected one of form 'delassus', got {batch.form!r}: sweeps go through A")
        rows, sweeps, omega = batch.layout.row_shape, whole("sweeps", sweeps), number("omega", omega)
        if warm_start is not None:
            warm_start = take("warm_start", warm_start, batch.dtype, rows, batch.device)
        cotangents, front = self._sets(batch, {"lambda_": lambda_, "w": w}, {"lambda_": rows, "w": rows})
        shapes = self._number_shapes(batch) | {"warm_start": rows}
        out = {name: front + shape for name, shape in shapes.items()} | {"lambda_": rows}

        def call(view, at, status, *arguments):
            self._core.unrolled_contacts(view, at, sweeps, omega, *arguments)

        return self._run(call, batch, warm_start, None, cotangents, out, front, stream)

    # -- pieces -------------------------------------------------------------------------------------------------------

    def _check(self, batch):
        if not isinstance(batch, Batch):
            raise TypeError(f"batch: expected a stiction.Batch, got {type(batch).__name__}")
        if batch.form == "bodies":
            raise ValueError("batch: expected a batch of form 'delassus' or 'jacobian', got 'bodies'")
        wanted = "cpu" if self.device in ("cpu", "emulated") else self.device
        if batch.device != wanted:
            raise ValueError(f"batch: expected a batch on {wanted}, got one on {batch.device}: make the Derivative with "
                             f"device={batch.device!r}")
        batch._refresh()

    @staticmethod
    def _answer(batch, solution, status):
        if isinstance(solution, Solution):
            status = solution._raw if status is None and batch.device != "cpu" else \
                solution.status if status is None else status
            solution = solution.lambda_
        if status is not None and batch.device != "cpu":
            status = take("status", status, "uint8", (len(batch), STATUS_DTYPE.itemsize), batch.device)
        elif status is not None:
            status = np.ascontiguousarray(status)
            if status.dtype != STATUS_DTYPE or status.shape != (len(batch),):
                raise ValueError(f"status: expected {len(batch)} records of stiction.STATUS_DTYPE, got {status.dtype} "
                                 f"{status.shape}")
            status = take("status", status.view(np.uint8).reshape(-1, STATUS_DTYPE.itemsize), "uint8",
                          (len(batch), STATUS_DTYPE.itemsize), "cpu")
        return take("lambda_", solution, batch.dtype, batch.layout.row_shape, batch.device), status

    @staticmethod
    def _number_shapes(batch):
        """Shapes of the derivatives by a batch's numbers."""
        seen = batch._seen
        names = ("J", "M", "v_free") if batch.form == "jacobian" else ("A",)
        shapes = {name: tuple(seen[name].shape) for name in names}
        for name in ("target", "R", "mu", "lo", "hi") if batch.form == "jacobian" else ("b", "R", "mu", "lo", "hi"):
            shapes[name] = batch.layout.row_shape
        return shapes

    @staticmethod
    def _sets(batch, given, shapes):
        """The arrays that are given, and the shape of the axis in front that they have in common."""
        fronts = {name: np.shape(value)[:np.ndim(value) - len(shapes[name])] for name, value in given.items()
                  if value is not None}
        front = next(iter(fronts.values()), ())
        if len(front) > 1:
            name = next(iter(fronts))
            raise ValueError(f"{name}: expected at most one axis before {shapes[name]}, got {np.shape(given[name])}")
        return {name: take(name, given[name], batch.dtype, front + shapes[name], batch.device) for name in fronts}, front

    def _run(self, call, batch, at, status, given, shapes, front, stream):
        on_device = self.device != "cpu"
        framework = batch.framework if on_device else NUMPY
        out = {name: framework.zeros(shape, batch.dtype, batch.device) for name, shape in shapes.items()}
        records = framework.zeros((len(batch), GRADIENT_DTYPE.itemsize), "uint8", batch.device)
        handle = streams.handle_of(stream, batch.framework, batch.device)
        call(batch._view(on_device), at, status, given, {name: look(name, array) for name, array in out.items()},
             look("gradient_status", records), int(np.prod(front, dtype=int)), handle,
             batch._room() if on_device else None)

        def read():
            self._core.synchronize(handle)
            return as_numpy("status", to_host(records)).view(GRADIENT_DTYPE).reshape(-1)

        found = Gradients(**out, status=read)
        if not (on_device and (stream is not None or batch.framework.has_streams)):
            found.status  # noqa: B018: waits
        return found
