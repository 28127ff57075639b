"""A simulation loop's solver: every step starts from the last one's reactions, contact by contact."""

from __future__ import annotations

import time

import numpy as np

from .. import _core
from . import streams
from .arguments import number, whole
from .arrays import as_numpy, look, take
from .batch import Batch
from .solution import Solution
from .solver import need_twists, SolverBase

#: Law and time stepping of a batch of bodies without other ones (Batch.from_bodies).
_DEFAULT_STEPPING = ("coulomb", 0.005, 0.2, 0.0, 0.0, 0.1, 1, 0)


class SteppingSolver(SolverBase):
    """Solves step after step of many environments side by side, warm started by contact id.

        solver = stiction.SteppingSolver(4096, device="cuda", max_rows=48, dtype="float32")
        batch = stiction.Batch.from_delassus(A, b, mu=mu, cone_counts=contacts)   # arrays of fixed shape
        while True:
            ...                               # write this step's A, b, mu, contacts, ids in place
            solution = solver.step(batch, ids, dt)
            solver.reset(mask=done)

    n_envs: environments of every step. device: as for Solver. form: of the batches to come, "delassus", "jacobian" or
    "bodies". max_rows, max_cones: room of one environment (cones: as many as rows if not given; a contact of bodies is
    a cone of three rows). max_dofs: degrees of freedom of one environment, for the Jacobian form on a GPU.
    semidefinite: whether cones of that kind will come, for which a GPU takes room. dtype: "float32" or "float64". beta:
    part of the last reaction to start from, in (0, 1]. scaling: its response to a change of dt. "capped": lambda is a
    force, and no more impulse than before; the default. "none": a force that lasts. Also "proportional": lambda is an
    impulse; the default of bodies. All other options as for Solver.

    All memory is taken here; on a GPU a step queues and returns, and may be captured into a CUDA graph. Bodies are
    planned anew in every step, which takes memory as they need it and waits for a batch in device memory.
    """

    def __init__(self, n_envs: int, device: str = "cpu", *, max_rows: int, max_cones: int | None = None,
                 form: str = "delassus", max_dofs: int | None = None, semidefinite: bool = False,
                 dtype: str = "float64", beta: float = 0.95, scaling: str | None = None, **options):
        if options.get("record_failures") is not None:
            raise ValueError("record_failures: expected a stiction.Solver, whose warm starts can be recorded, got a "
                             "SteppingSolver")
        super().__init__(**options)
        if form not in ("delassus", "jacobian", "bodies"):
            raise ValueError(f"form: expected 'delassus', 'jacobian' or 'bodies', got {form!r}")
        self._check_form(form)
        self.form, self.n_envs, self.max_rows = form, whole("n_envs", n_envs), whole("max_rows", max_rows)
        cones = self.max_rows // 3 if form == "bodies" else self.max_rows
        self.max_cones = cones if max_cones is None else whole("max_cones", max_cones)
        self.max_dofs = None if max_dofs is None else whole("max_dofs", max_dofs)
        self.semidefinite = bool(semidefinite)
        self.dtype = str(np.dtype(dtype))
        if self.dtype not in ("float32", "float64"):
            raise TypeError(f"dtype: expected float32 or float64, got {self.dtype}")
        if self.max_dofs is not None and self.max_dofs < 0:
            raise ValueError(f"max_dofs: expected a count from 0 on, got {self.max_dofs}")
        if self.n_envs < 1 or self.max_rows < 0 or self.max_cones < 0:
            raise ValueError(f"n_envs, max_rows, max_cones: expected at least 1, 0 and 0, got {self.n_envs}, "
                             f"{self.max_rows}, {self.max_cones}")
        # One cone more in each padded environment: the entry that closes its last.
        self._most_cones = self.n_envs * (self.max_cones + (form != "bodies"))
        self._stepping = _DEFAULT_STEPPING
        self._core = self._make(str(device), number("beta", beta),
                                scaling or ("proportional" if form == "bodies" else "capped"))
        self.device = self._core.device
        self._ids = {}  # batch's framework and shape -> ids with the closing entries
        self._hits = self._misses = 0
        self._stream = None  # of steps whose hits have not been read

    def _make(self, device, beta, scaling):
        """The solver of that form."""
        envs, rows, wide = self.n_envs, self.max_rows, self.dtype == "float64"
        if self.form == "bodies":
            return _core.Stepper(device, _core.BodyOptions(self._options, self.solver, *self._stepping), envs, self._most_cones,
                                 wide, beta, scaling)
        if self.form == "delassus":
            room = _core.Capacity(envs, envs * rows, self._most_cones, envs * rows * rows, rows, rows ** 2, 0, wide,
                                  self.semidefinite)
            return _core.Stepper(device, self._options, room, beta, scaling)
        if self.max_dofs is None and device != "cpu":
            raise ValueError("max_dofs: expected the degrees of freedom of the largest environment, which a device takes "
                             "room for, got None")
        room = _core.JacobianCapacity.of_largest(envs, rows, self.max_cones + 1, self.max_dofs or 0)
        room.semidefinite = self.semidefinite
        return _core.Stepper(device, self._options, room, wide, beta, scaling)

    def step(self, batch: Batch, ids, dt: float | None = None, out=None, stream=None) -> Solution:
        """Solves this step and returns its Solution.

        batch: of the solver's form, padded (B, n, ...) or flat. ids: int64 or uint64 contact ids, (B, cones) padded or
        (cones,) flat, of bodies shaped as body_a, on the batch's device. They are unique within an environment; the
        same contact has the same id in every step. dt: length of the step [s]; of bodies their batch's, and may be
        left out.
        out, stream: as for Solver.solve.

        More contacts than room are cut off where they begin, and the environment is flagged "contacts_dropped"; a batch beyond
        n_envs, max_rows and max_cones raises ValueError.
        """
        on_device = self._on_device(batch)
        if batch.form != self.form:
            raise ValueError(f"batch: expected form {self.form!r}, for which the solver was made, got {batch.form!r}")
        if batch.dtype != self.dtype:
            raise TypeError(f"batch: expected {self.dtype}, for which the solver was made, got {batch.dtype}")
        dt = self._length_of(batch, dt)
        self._check_room(batch)
        handle = streams.handle_of(stream, batch.framework, batch.device)
        batch._refresh()
        seen_ids = self._take_ids(batch, ids)
        solution = Solution.empty(batch) if out is None else Solution.over(batch, out)
        seen = solution._seen
        if self.form == "bodies":
            need_twists(seen)
            self._follow(batch)
        start = time.perf_counter()
        self._core.step(batch._view(on_device), seen_ids, dt, seen["lambda_"], seen.get("w"), seen.get("velocities"),
                        seen["status"], handle)
        queued = self._finish(batch, solution, None, stream, handle, on_device, start)
        if queued:
            self._stream = handle
        else:
            self._count(handle)
        return solution

    def _length_of(self, batch, dt):
        if self.form != "bodies":
            if dt is None:
                raise ValueError("dt: expected the length of the step [s], got None")
            return float(dt)
        own = batch.stepping[0]
        if dt is not None and float(dt) != own:
            raise ValueError(f"dt: expected that of the batch of bodies, {own}, or None, got {float(dt)}")
        return own

    def _check_room(self, batch):
        bodies = self.form == "bodies"
        rows = batch.rows
        cones = rows // 3 if bodies else batch.layout.cone_count
        if len(batch) > self.n_envs or rows > self.n_envs * self.max_rows or cones > self._most_cones:
            note = "" if bodies else " (with one more for each padded environment)"
            raise ValueError(f"batch: expected at most {self.n_envs} environments, {self.n_envs * self.max_rows} rows and "
                             f"{self._most_cones} cones{note}, got {len(batch)}, {rows} and {cones}: construct the solver "
                             "with more")
        if not bodies and self.device != "cpu" and not self.semidefinite and batch.layout.padded \
                and batch.layout.has("semidefinite"):
            raise ValueError("batch: expected no cones of semidefinite, for which the device has no room: construct the solver "
                             "with semidefinite=True")
        if self.form == "jacobian" and self.max_dofs is not None:
            dofs = int(batch._most_dofs())
            if dofs > self.max_dofs:
                raise ValueError(f"batch: expected at most {self.max_dofs} degrees of freedom in an environment, got "
                                 f"{dofs}: construct the solver with more")

    def _follow(self, batch):
        """Steps by this batch of bodies."""
        stepping = (batch.law, *batch.stepping)
        if stepping != self._stepping:
            self._core.change(_core.BodyOptions(self._options, self.solver, *stepping))
            self._stepping = stepping

    def reset(self, ids=None, mask=None, stream=None) -> None:
        """Drops the reactions of environments that start over. They are those of a list of indices, or wherever mask
        is not zero (bool or uint8 (n_envs,), on the solver's device), or all.
        """
        if ids is not None and mask is not None:
            raise ValueError("ids: expected ids or mask, got both")
        handle = streams.handle_of(stream, None, "cpu")
        if mask is not None:
            dtype = look("mask", mask).dtype
            device = self.device if self.device.startswith("cuda") else "cpu"
            self._core.reset_where(take("mask", mask, "bool" if dtype == "bool" else "uint8",
                                        (self.n_envs,), device), handle)
        elif ids is not None:
            self._core.reset([whole("ids", env) for env in np.asarray(ids).reshape(-1).tolist()], handle)
        else:
            self._core.reset_all(handle)

    def stats(self) -> dict:
        """Solver.stats(), and warm_start_hits and warm_start_misses: contacts that started from a stored reaction,
        and that did not. In device memory only the last step is counted.
        """
        if self._stream is not None:
            self._count(self._stream)
            self._stream = None
        return {**super().stats(), "warm_start_hits": self._hits, "warm_start_misses": self._misses}

    def _count(self, handle):
        hits, misses = self._core.warm_start_counts(handle)
        self._hits += hits
        self._misses += misses

    def _take_ids(self, batch, ids):
        dtype, bodies = look("ids", ids).dtype, self.form == "bodies"
        take("ids", ids, dtype if dtype in ("int64", "uint64") else "uint64",
             batch.contact_shape if bodies else batch.layout.cone_shape, batch.device)
        if bodies or not batch.layout.padded:
            return look("ids", ids)
        key = (batch.framework, batch.layout.cone_shape, dtype)
        if key not in self._ids:
            envs, cones = batch.layout.cone_shape
            room = batch.framework.zeros((envs, cones + 1), dtype, batch.device)
            self._ids[key] = (room, look("ids", room))
        room, seen = self._ids[key]
        if batch.device == "cpu":
            as_numpy("ids", room)[:, :-1] = as_numpy("ids", ids)
        else:
            room[:, :-1] = ids
        return seen


ParallelContactSolver = SteppingSolver  #: the textbook chapter's name for it
