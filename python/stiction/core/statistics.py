"""Statistics of solves, and files of failures."""

import os
import pathlib
import tempfile

import numpy as np

from .. import _core
from .arrays import STATUS_DTYPE
from .body_rows import check as check_rows
from .flags import FLAGS
from .solution import CODES, SOLVED, solver_name

#: Environments whose iterations and residuals quantiles are taken of: the last ones.
WINDOW = 65536
_MOST_RECORDED = 256


def _writable(name, folder):
    """The path of a folder that files can be written to, or that can be made. It is not made before there is a file for
    it. Raises ValueError where it cannot be."""
    folder = os.fspath(folder)
    above = pathlib.Path(folder).absolute()
    while not above.exists() and above != above.parent:
        above = above.parent
    try:
        with tempfile.TemporaryFile(dir=above):
            return folder
    except OSError as error:
        raise ValueError(f"{name}: expected a folder that can be written to, got {str(folder)!r} ({above}: "
                         f"{error.strerror}): name another one") from None


class Statistics:
    """Counts a solver's solves."""

    def __init__(self, solver, callback=None, record_failures=None):
        self._solver, self._callback = solver, callback
        self._folder = None if record_failures is None else _writable("record_failures", record_failures)
        self._files = {}
        self._solves, self._environments, self._seconds, self._warm = 0, 0, 0.0, 0
        self._codes, self._flags, self._solvers = np.zeros(256, int), np.zeros(32, int), np.zeros(256, int)
        self._recent = np.zeros(0, STATUS_DTYPE)  # records of the last environments
        self._fresh, self._fresh_count = [], 0    # records that are not counted yet
        self._late = []

    @property
    def only_keeps(self):
        """True if a complete solve needs keep() alone."""
        return self._folder is None and self._callback is None

    def keep(self, environments, seconds, is_warm, records, solves=1):
        """Takes solves of so many environments in: all their status records, an array or its bytes, or None."""
        self._solves += solves
        self._environments += solves * environments
        self._seconds += seconds
        self._warm += solves * is_warm
        if records is not None:
            self._take(records)

    def note(self, batch, solution, guess, seconds, queued, has_velocities=False):
        """Takes one solve in. One that is still queued is read when it is requested: nothing waits for it here."""
        self.keep(len(batch), seconds, guess is not None or has_velocities, None if queued else solution.status)
        if queued:
            self._late = [solution]
            return
        status = solution.status
        if self._folder is not None and (status["code"] != SOLVED).any():
            self._record(batch, solution, guess)
        if self._callback is not None:
            self._callback(summary(status, seconds))

    def _take(self, records):
        fresh = records if isinstance(records, bytes) else records.tobytes()  # copied at once, not field by field
        self._fresh.append(fresh)
        self._fresh_count += len(fresh) // STATUS_DTYPE.itemsize
        if self._fresh_count > WINDOW:
            self._count()

    def _count(self):
        """Counting is dearer than keeping, for small batches: it is done for many of them at once."""
        if not self._fresh:
            return
        fresh = b"".join(self._fresh)
        status = np.frombuffer(fresh, STATUS_DTYPE)
        self._fresh, self._fresh_count = [], 0
        self._codes += np.bincount(status["code"], minlength=256)
        self._solvers += np.bincount(status["solver"], minlength=256)
        if status["flags"].any():
            self._flags += ((status["flags"][:, None] >> np.arange(32, dtype=np.uint32)) & 1).sum(axis=0).astype(int)
        if len(status) < WINDOW:
            status = np.frombuffer(self._recent.tobytes() + fresh, STATUS_DTYPE)
        self._recent = status[-WINDOW:]

    def _record(self, batch, solution, guess):
        if batch.form != "delassus" and batch.device != "cpu":
            return
        key = (batch.form, batch.law, batch.dtype)
        if key not in self._files:
            os.makedirs(self._folder, exist_ok=True)
            path = os.path.join(self._folder, f"failures_{os.getpid()}_{id(self):x}_{'_'.join(key)}.h5")
            self._files[key] = _core.FailureFile(path, _MOST_RECORDED)
        rows = batch.as_jacobian() if batch.form == "bodies" else batch
        view = rows._view(self._solver.device == "emulated" and batch.form != "bodies")
        more = () if batch.form == "delassus" else (batch.form == "bodies",)
        self._files[key].take(self._solver._core, view, solution._seen["lambda_"], solution._seen["status"], guess, *more)

    def recode(self, count, before, after):
        """Counts so many environments of the last solve under another code, which is known after it."""
        self._codes[before] -= count
        self._codes[after] += count

    def check(self, batch):
        """Raises ValueError for a batch whose failures could not be written, before it is solved."""
        if self._folder is None or batch.form != "bodies" or batch.device != "cpu":
            return
        try:
            check_rows(batch)
        except ValueError as error:
            raise ValueError(f"record_failures: bodies are written as J and M; {error}") from None

    def stats(self):
        """The entries of Solver.stats()."""
        for solution in self._late:
            self._take(solution.status)
        self._late = []
        self._count()
        return {
            "solves": self._solves, "environments": self._environments, "seconds": self._seconds,
            "warm_started": self._warm, "recorded": sum(file.recorded for file in self._files.values()),
            "codes": {name: int(self._codes[i]) for i, name in enumerate(CODES) if self._codes[i]},
            "flags": {name: int(self._flags[i]) for i, name in enumerate(FLAGS) if self._flags[i]},
            "solvers": {solver_name(i): int(count) for i, count in enumerate(self._solvers) if count},
            "iterations": quantiles(self._recent["iterations"]), "residual": quantiles(self._recent["residual"]),
        }


def spans_by_kind(spans):
    """Spans of a trace as {place/name or place/name/detail: {count, seconds}}."""
    kinds = {}
    for name, detail, place, _, duration in spans:
        kind = kinds.setdefault("/".join(part for part in (place, name, detail) if part), {"count": 0, "seconds": 0.0})
        kind["count"] += 1
        kind["seconds"] += duration * 1e-6
    return kinds


def quantiles(values):
    """p50, p90, p99 and max; empty without values."""
    if not len(values):
        return {}
    p50, p90, p99 = np.quantile(values, [0.5, 0.9, 0.99], method="higher")
    return {"p50": float(p50), "p90": float(p90), "p99": float(p99), "max": float(values.max())}


def summary(status, seconds):
    """One solve as a flat dict, as callbacks get it: environments, seconds, solved (share), iterations_p50, _p99, _max,
    residual_p50, _p99, _max.
    """
    out = {"environments": len(status), "seconds": seconds,
           "solved": float((status["code"] == SOLVED).mean()) if len(status) else 1.0}
    for name in ("iterations", "residual"):
        found = quantiles(status[name])
        out.update({f"{name}_{key}": found[key] for key in ("p50", "p99", "max") if found})
    return out
