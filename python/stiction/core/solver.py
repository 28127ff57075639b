"""The solver: one device, one set of options, any number of batches."""

from __future__ import annotations

import functools
import os
import time

import numpy as np

from .. import _core
from . import streams
from .arguments import number, whole, word
from .arrays import NUMPY, take
from .batch import Batch
from .solution import SOLVERS, Solution
from .statistics import Statistics, spans_by_kind


#: Keys of a capacity: counts, then the flags of its room.
_COUNTS = ("envs", "rows", "cones", "nonzeros", "env_rows", "env_nonzeros", "env_dofs")
_SWITCHES = ("wide", "semidefinite")


#: Keys of the rules of a choice by spectrum (docs/howto/spectrum.md).
_RULES = {"steps": whole, "direct_condition": number, "direct_rows": whole, "preconditioned_condition": number,
          "sparse_density": number, "keep": lambda name, value: bool(value), "direct": word, "preconditioned": word,
          "decomposed": word, "otherwise": word}


def _rules(spectrum):
    """A dict of rules, checked."""
    rules = dict(spectrum or {})
    for name in rules:
        if name not in _RULES:
            raise ValueError(f"spectrum: expected rules of {', '.join(_RULES)}, got {name!r}")
    return {name: _RULES[name](f"spectrum[{name!r}]", value) for name, value in rules.items()}


class SolverBase:
    """Base of every solver: options, statistics, a device and its queued work."""

    def __init__(self, solver=None, law=None, tolerance=None, max_iterations=None, threads=0, *, preset=None,
                 invalid="isolate", omega=1.0, stall_window=2000, islands="together", direct_rows=1024, callback=None,
                 record_failures=None, trace=False, absolute_tolerance=0.0, choose="named", spectrum=None,
                 blocks="cones"):
        if invalid not in ("isolate", "reject"):
            raise ValueError(f"invalid: expected 'isolate' or 'reject', got {invalid!r}")
        chosen = {"solver": "auto", "tolerance": 1e-4, "max_iterations": 1000}
        if preset is not None:
            chosen = _core.preset(word("preset", preset))
        given = {"solver": solver, "tolerance": tolerance, "max_iterations": max_iterations}
        chosen.update({name: value for name, value in given.items() if value is not None})
        self.solver, self.tolerance = chosen["solver"], number("tolerance", chosen["tolerance"])
        self.max_iterations, self.law = whole("max_iterations", chosen["max_iterations"]), law
        if self.solver not in SOLVERS + ("auto", "multigrid"):
            raise ValueError(f"solver: expected one of auto, {', '.join(SOLVERS)}, multigrid, got {self.solver!r}")
        self._tracer = _core.Tracer() if trace else None
        # Only bodies have a multigrid solver, which they choose by name.
        self._options = _core.Options("npgs" if self.solver == "multigrid" else self.solver,
                                      None if law is None else word("law", law), self.tolerance, self.max_iterations,
                                      whole("stall_window", stall_window), number("omega", omega),
                                      whole("threads", threads), invalid == "isolate", word("islands", islands),
                                      whole("direct_rows", direct_rows), self._tracer,
                                      number("absolute_tolerance", absolute_tolerance), word("choose", choose),
                                      _rules(spectrum), word("blocks", blocks))
        self.choose = choose
        if choose != "named":
            if solver is not None:
                raise ValueError(f"solver: expected None beside choose={choose!r}, got {solver!r}")
            self.solver = "auto"
        self._statistics = Statistics(self, callback, record_failures)
        self._in_flight = []  # arrays that a device has yet to read and write

    def __repr__(self):
        return f"<stiction.{type(self).__name__} {self.solver} on {self.device}, tolerance {self.tolerance:g}>"

    def synchronize(self, stream=0) -> None:
        """Returns when the work queued on that stream is done. Raises stiction.Error (device_failure) if it failed."""
        self._core.synchronize(streams.handle_of(stream, None, "cpu"))
        self._in_flight.clear()

    def stats(self) -> dict:
        """Statistics of all solves since the solver was made. It has solves, environments and seconds (of solves,
        queueing alone for those that were queued). warm_started are solves that were given a warm start, recorded are
        environments written to files. For the environments read it has codes, flags and solvers (count by name),
        iterations and residual (quantiles over the last ones). With trace=True also `spans`: count and seconds of
        every kind of work, on the host and on the device by kernel and class of environments.

        In device memory only the last solve is read, and waited for.
        """
        found = self._statistics.stats()
        if self._tracer is not None:
            found["spans"] = spans_by_kind(self._tracer.spans())
        return found

    def write_trace(self, path: str | os.PathLike) -> None:
        """Writes the spans of a solver made with trace=True as JSON for Perfetto or chrome://tracing."""
        if self._tracer is None:
            raise ValueError("write_trace: expected a solver made with trace=True")
        with open(path, "w", encoding="utf-8") as file:
            file.write(self._tracer.chrome_json())

    def _check_form(self, form):
        """Refuses a solver that has none for batches of that form."""
        if self.choose != "named" and form == "bodies":
            raise ValueError(f"choose: expected 'named' for bodies, which have no matrix A, got {self.choose!r}")
        if self.solver == "multigrid" and form != "bodies":
            raise ValueError("solver: expected a solver of contact batches, got 'multigrid', which works on bodies alone "
                             "(Batch.from_bodies)")

    def _on_device(self, batch):
        """True if the batch lies in the memory of this solver's device, and not of the host."""
        if not isinstance(batch, Batch):
            raise TypeError(f"batch: expected a stiction.Batch, got {type(batch).__name__}")
        name = next(iter(batch.arrays), "batch")
        wanted = "cpu" if self.device in ("cpu", "emulated") else self.device
        if batch.device != wanted and (batch.device != "cpu" or batch.form == "jacobian"):
            raise ValueError(f"{name}: expected an array on {wanted}, got one on {batch.device}: move the batch's arrays "
                             f"there, or make the solver with device={batch.device!r}")
        return self.device == "emulated" or batch.device != "cpu"

    def _finish(self, batch, solution, guess, stream, handle, on_device, start, moving=None):
        """Waits where the caller could not, counts, and returns whether the answer is still queued."""
        queued = on_device and (stream is not None or batch.framework.has_streams)
        if queued:
            # Memory of frameworks with streams outlives its last use on its stream by their own care.
            if not batch.framework.has_streams:
                self._in_flight.append((batch, solution, guess, moving))
            solution._wait = lambda: self.synchronize(handle)
        elif on_device:
            self._core.synchronize(handle)
        self._statistics.note(batch, solution, guess, time.perf_counter() - start, queued, moving is not None)
        return queued


class _CachedCall:
    """A solve as it was, for as long as the same objects are given again. A training loop calls with nothing else, and
    in a call that finds its caches empty every line of Python that does not run counts.
    """

    __slots__ = ("batch", "out", "warm_start", "warm_velocities", "environments", "refresh", "run")

    def __init__(self, batch, out, warm_start, warm_velocities, run):
        self.batch, self.out, self.run = batch, out, run
        self.warm_start, self.warm_velocities = warm_start, warm_velocities
        self.environments = len(batch)
        is_fixed = batch.layout is None or batch.layout.fixed
        self.refresh = None if is_fixed else batch._refresh


class Solver(SolverBase):
    """Solves batches on one device. Changing the device changes the speed and not one bit.

    device: "cpu", "cuda", "cuda:1", "auto" (the first usable GPU, else the CPU), or "emulated". "emulated" runs the
        GPU's programs on the CPU, for tests; its device memory is any memory of the process.
    solver: "auto" (the default: one for each environment, and the next where it falls short), "npgs", "subspace",
        "pgs", "apgd", "nsgs", "jacobi", "admm", "newton", "ipm", "lemke". For bodies: "pgs" (sequential impulses), "newton" or
        "multigrid" (Newton's method with that preconditioner); any other name: sequential impulses with momentum.
    law: "convex" or "coulomb" instead of the batch's.
    tolerance: on the relative residual [-], 1e-4 if not given; 0: all iterations. max_iterations: 1000 if not given.
    absolute_tolerance: on the largest error of a contact, in the unit of b [w]; an environment is solved where either
        holds.
    threads: of the CPU, 0: all cores. The bits do not depend on it.
    preset: "navigation", "locomotion", "grasping" or "assembly": solver, tolerance and iterations of that task where
        they are not given.
    invalid: "isolate": an environment with NaN, mu < 0 and so on is flagged, gets zeros and spoils no other one.
        "reject": stiction.Error names the first defect.
    omega: relaxation of sweeps, 0 < omega < 2. stall_window: iterations without progress before it stops, 0: never.
    islands: "together" or "apart" (docs/howto/islands.md).
    blocks: "pairs" or "strong": sweeps of "pgs", "npgs" and "nsgs" solve coupled contacts together, of batches on
        the host (docs/howto/blocks.md). Sweeps of bodies take "pairs".
    asynchronous: sweeps of bodies by threads that wait for no colour, law "convex", on the CPU. No two runs need have
        equal bits (docs/math/si.md).
    choose: "spectrum" takes a solver for each environment by condition and density of its operator, of batches on the
        host (docs/howto/spectrum.md). Environments that fall short go to "auto". spectrum: a dict of rules: thresholds
        and solvers.
    direct_rows: rows of the largest environment that admm, newton, ipm and lemke take a matrix for, 1024 to 32768. It
        is for the CPU only, and not with "auto".
    capacity: dict of room to take at once on a GPU: envs, rows, cones, nonzeros, env_rows, env_nonzeros, env_dofs.
        Beside these, wide: room for double precision, the default; semidefinite: for cones of that kind, not by default.
    callback: called with a dict after every solve that is complete on return (stiction.monitor).
    record_failures: folder for environments that were not solved, as batch files for `stiction solve` and
        `stiction replay`. Batches of J and M, and of bodies as such, are written with J and M from host memory alone.
    trace: collect where the time goes, for stats() and write_trace(); no bit depends on it.

    Copied or pickled, a solver is one made anew by the same arguments. Statistics and device memory stay behind.

    Raises stiction.Error (code "invalid_argument", "no_device", "unsupported") for batches that the library refuses.
    """

    def __init__(self, device: str = "cpu", solver: str | None = None, law: str | None = None,
                 tolerance: float | None = None, max_iterations: int | None = None, threads: int = 0, *,
                 capacity: dict | None = None, asynchronous: bool = False, **options):
        super().__init__(solver, law, tolerance, max_iterations, threads, **options)
        self._asynchronous = bool(asynchronous)
        self._made_by = dict(device=device, solver=solver, law=law, tolerance=tolerance, max_iterations=max_iterations,
                             threads=threads, capacity=capacity, asynchronous=asynchronous, **options)
        self._core = _core.FormSolver(str(device), self._options, _core.Capacity(**_rooms(capacity)))
        self.device = self._core.device
        self._bodies = {}  # (law, stepping) -> the C++ solver of bodies
        self._last = None  # the last solve, if it can be repeated as it was

    def __reduce__(self):
        return _made_by, (type(self), self._made_by)

    def solve(self, batch: Batch, out=None, warm_start=None, stream=None, *, warm_velocities=None, guess=None,
              ids=None) -> Solution:
        """Solves every environment of the batch and returns the Solution.

        out: a Solution of an earlier solve, or a dict of arrays to be written in place; None: new memory. The arrays
            are lambda_, status (uint8 (B, 32) or STATUS_DTYPE), w and velocities (may be left out).
        warm_start: reactions to start from, shaped like lambda_, or a Solution; None: zero.
        warm_velocities: of J and M, velocities to start from [v], shaped like `velocities` of the answer, which they
            may be. None: those of a Solution given as warm_start, else v_free. They are for Newton's method in
            velocities.
        guess, ids: a stiction.learning.Guess, which chooses the reactions to start from by the ids of contacts, and
            remembers those found. It comes in place of warm_start.
        stream: CUDA stream to queue on, an int, a PyTorch, CuPy or Warp stream, or an object with __cuda_stream__.
            None: the one that the batch's framework works in. Solves of host memory are complete on return; of device
            memory they are queued, unless the framework has no streams.
        """
        if guess is not None:
            if warm_start is not None or warm_velocities is not None:
                raise ValueError("warm_start: expected None beside a guess, got both")
            if ids is None:
                raise ValueError("ids: expected the ids of contacts, by which a guess knows them, got None")
            if not hasattr(guess, "start"):
                raise TypeError(f"guess: expected a stiction.learning.Guess, got {type(guess).__name__}")
            return guess.solve(self, batch, ids, out, stream)
        last = self._last
        if (last is not None and batch is last.batch and out is last.out and warm_start is last.warm_start
                and warm_velocities is last.warm_velocities and stream is None):
            if last.refresh is not None:
                last.refresh()
            start = time.perf_counter()
            last.run()
            is_warm = warm_start is not None or warm_velocities is not None
            self._statistics.keep(last.environments, time.perf_counter() - start, is_warm, out._raw)
            return out
        on_device = self._on_device(batch)
        self._statistics.check(batch)
        handle = streams.handle_of(stream, batch.framework, batch.device)
        batch._refresh()
        solution = Solution.empty(batch) if out is None else Solution.over(batch, out)
        given = warm_start, warm_velocities
        if isinstance(warm_start, Solution):
            if warm_velocities is None and batch.form == "jacobian":
                warm_velocities = warm_start.velocities
            warm_start = warm_start.lambda_
        guess = None if warm_start is None else take(
            "warm_start", warm_start, batch.dtype, tuple(solution._seen["lambda_"].shape), batch.device)
        moving = None if warm_velocities is None else self._take_velocities(batch, warm_velocities)
        run = self._call(batch, solution, guess, moving, handle, on_device)
        start = time.perf_counter()
        run()
        self._finish(batch, solution, guess, stream, handle, on_device, start, moving)
        # Memory of other frameworks may become other memory behind the same object.
        is_plain = solution is out and stream is None and not on_device and not isinstance(given[0], Solution)
        can_repeat = is_plain and batch.framework is NUMPY and self._statistics.only_keeps
        self._last = _CachedCall(batch, out, *given, run) if can_repeat else None
        return solution

    @staticmethod
    def _take_velocities(batch, velocities):
        """The caller's velocities to start from, in a batch that has any use for them."""
        if batch.form != "jacobian":
            raise ValueError(f"warm_velocities: expected None for a batch of form {batch.form!r}: they are for batches of J "
                             "and M (Batch.from_jacobian)")
        return take("warm_velocities", velocities, batch.dtype, batch.dof_shape, batch.device)

    def _call(self, batch, solution, guess, moving, handle, on_device):
        """The call of the C++ solver that this is."""
        view, seen, room = batch._view(on_device), solution._seen, batch._room() if on_device else None
        lambda_, w, status = seen["lambda_"], seen.get("w"), seen["status"]
        self._check_form(batch.form)
        if self._asynchronous and batch.form != "bodies":
            raise ValueError(f"asynchronous: expected a batch of bodies (Batch.from_bodies), got form {batch.form!r}")
        if batch.form == "delassus":
            return functools.partial(self._core.solve_contacts, view, lambda_, w, status, guess, handle, room)
        if batch.form == "jacobian":
            return functools.partial(self._core.solve_jacobian, view, lambda_, w, seen.get("velocities"), status, guess,
                                     moving, handle, room)
        need_twists(seen)
        key = (batch.law, *batch.stepping)
        if key not in self._bodies:
            self._bodies[key] = _core.BodySolver(
                self.device, _core.BodyOptions(self._options, self.solver, *key, asynchronous=self._asynchronous))
        return functools.partial(self._bodies[key].solve, view, lambda_, w, seen["velocities"], status, guess, handle)


def _made_by(cls, arguments):
    return cls(**arguments)


def _rooms(capacity):
    """The caller's room by name."""
    rooms = {} if capacity is None else capacity
    if not isinstance(rooms, dict):
        raise TypeError(f"capacity: expected a dict, got {type(rooms).__name__}")
    for name in rooms:
        if name not in _COUNTS + _SWITCHES:
            raise ValueError(f"capacity: expected {', '.join(_COUNTS + _SWITCHES)}, got {name!r}")
    counts = {name: whole(f"capacity[{name!r}]", value, 2**63 - 1) for name, value in rooms.items() if name in _COUNTS}
    for name, count in counts.items():
        if count < 0:
            raise ValueError(f"capacity[{name!r}]: expected a count from 0 on, got {count}")
    return counts | {name: bool(value) for name, value in rooms.items() if name in _SWITCHES}


def need_twists(seen):
    """Refuses an answer of bodies that has nowhere to put their twists."""
    if "velocities" not in seen:
        raise ValueError("out['velocities']: expected an array for the twists of bodies, got None")


def verify(batch: Batch, solution) -> np.ndarray:
    """(relative, absolute) residual of each environment, float64 (B, 2) [-, w]. It is recomputed in double from the
    batch's own numbers by code that shares nothing with the solvers.

    solution: a Solution of this batch, or its reactions alone.
    """
    return _judged("verify", batch, solution)[:, :2].copy()


def worst_contacts(batch: Batch, solution) -> np.ndarray:
    """The contact of each environment with the largest relative error, a structured array (B,).

    Fields are `cone`, counted within the environment (-1: no contact has an error), `error` [w], and `scale` [w], which
    is that of its island.

    solution: a Solution of this batch, or its reactions alone.
    """
    judged = _judged("worst_contacts", batch, solution)
    found = np.zeros(len(judged), [("cone", np.int32), ("error", np.float64), ("scale", np.float64)])
    found["error"], found["scale"], found["cone"] = judged[:, 2], judged[:, 3], judged[:, 4]
    return found


def _judged(call, batch, solution):
    """(relative, absolute, error of the worst contact, its island's scale, the contact), float64 (B, 5)."""
    if batch.form == "bodies":
        raise ValueError(f"{call}: expected a batch of form 'delassus' or 'jacobian', got 'bodies'")
    if batch.device != "cpu":
        raise ValueError(f"{call}: expected a batch on cpu, got one on {batch.device}: copy its arrays to the host")
    if isinstance(solution, Solution):
        solution.synchronize()
        solution = solution.lambda_
    batch._refresh()
    lambda_ = take("lambda_", solution, batch.dtype, batch.layout.row_shape, "cpu")
    return np.array(_core.verify(batch._view(False), lambda_), np.float64).reshape(-1, 5)
