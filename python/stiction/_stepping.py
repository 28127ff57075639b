"""A simulation loop's solver: every step starts from the last one's reactions, contact by contact."""

from __future__ import annotations

import time

import numpy as np

from . import _core, _streams
from ._arrays import as_numpy, look, take
from ._batch import Batch
from ._solution import Solution
from ._solver import Machine


class ParallelContactSolver(Machine):
    """Solves step after step of many environments side by side, warm started by contact id.

        solver = stiction.ParallelContactSolver(4096, device="cuda", max_rows=48, dtype="float32")
        batch = stiction.Batch.from_delassus(A, b, mu=mu, cone_counts=contacts)   # arrays of fixed shape
        while True:
            ...                               # write this step's A, b, mu, contacts, ids in place
            solution = solver.step(batch, ids, dt)
            solver.reset(mask=done)

    n_envs: environments of every step. device: as for Solver. max_rows, max_cones: room of one environment (cones: as
    many as rows if not given). dtype: "float32" or "float64". beta: part of the last reaction to start from, in (0, 1].
    scaling: what a change of dt does to it, "capped" (lambda is a force, and no more impulse than before), "none" (a
    force that lasts), "proportional" (lambda is an impulse). All other options as for Solver.

    All memory is taken here; on a GPU a step queues and returns, and may be captured into a CUDA graph.
    """

    def __init__(self, n_envs: int, device: str = "cpu", *, max_rows: int, max_cones: int | None = None,
                 dtype: str = "float64", beta: float = 0.95, scaling: str = "capped", **options):
        if options.get("record_failures") is not None:
            raise ValueError("record_failures: expected a stiction.Solver, whose warm starts can be recorded, got a "
                             "ParallelContactSolver")
        super().__init__(**options)
        self.n_envs, self.max_rows = int(n_envs), int(max_rows)
        self.max_cones = self.max_rows if max_cones is None else int(max_cones)
        self.dtype = str(np.dtype(dtype))
        if self.dtype not in ("float32", "float64"):
            raise TypeError(f"dtype: expected float32 or float64, got {self.dtype}")
        if self.n_envs < 1 or self.max_rows < 0 or self.max_cones < 0:
            raise ValueError(f"n_envs, max_rows, max_cones: expected at least 1, 0 and 0, got {self.n_envs}, "
                             f"{self.max_rows}, {self.max_cones}")
        # One cone more each: the entry that closes an environment's last.
        rows, cones = self.n_envs * self.max_rows, self.n_envs * (self.max_cones + 1)
        room = _core.Capacity(self.n_envs, rows, cones, rows * self.max_rows, self.max_rows, self.max_rows ** 2, 0,
                              self.dtype == "float64")
        self._core = _core.Stepper(str(device), self._options, room, float(beta), scaling)
        self.device = self._core.device
        self._ids = {}  # batch's framework and shape -> ids with the closing entries
        self._hits = self._misses = 0
        self._stream = None  # of steps whose hits have not been looked at

    def step(self, batch: Batch, ids, dt: float, out=None, stream=None) -> Solution:
        """Solves this step and returns its Solution.

        batch: of form "delassus", padded (B, n, n) or flat. ids: int64 or uint64 contact ids, (B, cones) padded or
        (cones,) flat, on the batch's device, unique within an environment; the same contact has the same id in every
        step. dt: length of the step [s]. out, stream: as for Solver.solve.

        More contacts than room are cut off where they begin, and the environment is flagged "capacity"; a batch beyond
        n_envs, max_rows and max_cones raises ValueError.
        """
        on_device = self._on_device(batch)
        if batch.form != "delassus":
            raise ValueError(f"batch: expected form 'delassus', got {batch.form!r}")
        if batch.dtype != self.dtype:
            raise TypeError(f"batch: expected {self.dtype}, for which the solver was made, got {batch.dtype}")
        layout = batch.layout
        beyond = len(batch) > self.n_envs or layout.row_count > self.n_envs * self.max_rows or \
            layout.cone_count > self.n_envs * (self.max_cones + 1)
        if beyond:
            raise ValueError(f"batch: expected at most {self.n_envs} environments, {self.n_envs * self.max_rows} rows and "
                             f"{self.n_envs * (self.max_cones + 1)} cones (with one more for each padded environment), "
                             f"got {len(batch)}, {layout.row_count} and {layout.cone_count}: construct the solver with "
                             "more")
        handle = _streams.handle_of(stream, batch.framework, batch.device)
        batch._refresh()
        seen_ids = self._take_ids(batch, ids)
        solution = Solution.empty(batch) if out is None else Solution.over(batch, out)
        seen = solution._seen
        start = time.perf_counter()
        self._core.step(batch._view(on_device), seen_ids, float(dt), seen["lambda_"], seen.get("w"), seen["status"],
                        handle)
        queued = self._finish(batch, solution, None, stream, handle, on_device, start)
        if queued:
            self._stream = handle
        else:
            self._count(handle)
        return solution

    def reset(self, ids=None, mask=None, stream=None) -> None:
        """Forgets the reactions of environments that start over: those of a list of indices, or wherever mask is not
        zero (bool or uint8 (n_envs,), on the solver's device), or all.
        """
        if ids is not None and mask is not None:
            raise ValueError("ids: expected ids or mask, got both")
        handle = _streams.handle_of(stream, None, "cpu")
        if mask is not None:
            dtype = look("mask", mask).dtype
            device = self.device if self.device.startswith("cuda") else "cpu"
            self._core.reset_where(take("mask", mask, "bool" if dtype == "bool" else "uint8",
                                        (self.n_envs,), device), handle)
        elif ids is not None:
            self._core.reset([int(env) for env in np.asarray(ids).reshape(-1)], handle)
        else:
            self._core.reset_all(handle)

    def stats(self) -> dict:
        """Solver.stats(), and warm_start_hits and warm_start_misses: contacts that started from a remembered reaction,
        and that did not. Of steps in device memory only the last one is counted.
        """
        if self._stream is not None:
            self._count(self._stream)
            self._stream = None
        return {**super().stats(), "warm_start_hits": self._hits, "warm_start_misses": self._misses}

    def _count(self, handle):
        hits, misses = self._core.recalled(handle)
        self._hits += hits
        self._misses += misses

    def _take_ids(self, batch, ids):
        dtype = look("ids", ids).dtype
        take("ids", ids, dtype if dtype in ("int64", "uint64") else "uint64", batch.layout.cone_shape, batch.device)
        if not batch.layout.padded:
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
