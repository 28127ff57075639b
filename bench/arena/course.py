"""One entrant on one set: runs at every tolerance, judged, hashed, in another order, with other threads, as an older machine."""

import dataclasses
import pathlib

import h5py
import numpy as np
from answer_file import Answer
from batch_file import entries, take
from bits import digest, restored
from judge import SLACK, residuals

SHARE = 95  # percentile of the residual beside the largest


def percentile(values, percent):
    """Nearest rank: one of the values; NaN counts as larger than everything."""
    return np.sort(values)[max(0, int(np.ceil(percent * len(values) / 100)) - 1)]


def finite(value, digits=3):
    """For JSON, which has no infinity: None."""
    return float(f"{value:.{digits}g}") if value is not None and np.isfinite(value) else None


def verdict(problems, answer, goal):
    """Columns of an entry that the judge fills; no claim of the solver enters them."""
    with h5py.File(problems.path) as batch:
        residual = residuals(batch, answer.reaction, problems.law)
    solved = residual <= SLACK * goal
    entry = {"solved": int(solved.sum()), "residual_max": finite(residual.max(initial=0.0)),
             "residual_p95": finite(percentile(residual, SHARE)) if len(residual) else 0.0,
             "claimed": None if answer.claimed is None else int(answer.claimed.sum()),
             "false_claims": None if answer.claimed is None else int((answer.claimed & ~solved).sum()),
             "iterations": None if answer.iterations is None else int(percentile(answer.iterations, 50)),
             "us": None if answer.seconds is None else finite(1e6 * np.sum(answer.seconds) / max(1, problems.environments)),
             "memory_mib": finite(answer.memory_mib), "hash": digest(answer.reaction)}
    return entry, solved


def merged(old, new, chosen, offsets):
    """The old answer with the chosen environments of the new one."""
    found = dataclasses.replace(old, reaction=old.reaction.copy(), late=old.late or new.late)
    rows = entries(offsets, chosen)
    found.reaction[rows] = new.reaction[rows]
    for name in ("seconds", "claimed", "iterations"):
        before, after = getattr(old, name), getattr(new, name)
        if before is not None and after is not None:
            setattr(found, name, np.where(np.isin(np.arange(len(before)), chosen), after, before))
    found.memory_mib = max((one for one in (old.memory_mib, new.memory_mib) if one is not None), default=None)
    return found


class Course:
    def __init__(self, entrant, problems, seconds, folder):
        self.entrant, self.problems, self.seconds, self.folder = entrant, problems, seconds, pathlib.Path(folder)
        self.is_late = False  # no answer to anything: none is asked for at a smaller tolerance
        self.order = np.random.default_rng(problems.environments).permutation(problems.environments)

    def run(self, goal):
        """The entry. The entrant's settings run one after the other; each environment keeps the first solved answer,
        or the best. Only those that a tighter setting may help are asked again."""
        first = answer = ask = None
        for setting in self.entrant.settings(goal):
            if answer is None:
                first = answer = self._solve(self.problems.path, setting)
                used, residual, at_first = setting, self._judge(answer), setting
            else:
                more = self._again(ask, setting)
                new = self._judge(more)
                better = ask[(new < residual)[ask]]
                used = setting if len(better) else used
                residual = np.where(np.isin(np.arange(len(residual)), better), new, residual)
                answer = merged(answer, more, better, self.problems.offsets)
            early = residual > SLACK * goal
            early &= np.isfinite(residual) if answer.claimed is None else answer.claimed
            ask = np.flatnonzero(early)
            if not len(ask):
                break
        entry, _ = verdict(self.problems, answer, goal)
        note = answer.note or ("some environments ran out of time" if answer.late else "")
        permuted, threads, machines = self._same_bits(at_first, first)
        self.is_late = not np.isfinite(answer.reaction).any()
        return {"set": self.problems.key, "solver": self.entrant.name, "tolerance": goal, **entry, "setting": used, "note": note,
                "permuted_equal": permuted, "threads_equal": threads, "machines_equal": machines}

    def _judge(self, answer):
        with h5py.File(self.problems.path) as batch:
            return residuals(batch, answer.reaction, self.problems.law)

    def _again(self, ask, setting):
        """An answer to some environments, as one to all: NaN elsewhere."""
        said = self._solve(take(self.problems.path, ask, self.folder / "again.h5"), setting)
        count, offsets = self.problems.environments, self.problems.offsets
        whole = Answer(np.full(offsets[-1], np.nan), memory_mib=said.memory_mib, late=said.late, note=said.note)
        whole.reaction[entries(offsets, ask)] = said.reaction
        for name in ("seconds", "claimed", "iterations"):
            values = getattr(said, name)
            if values is not None:
                full = np.zeros(count, values.dtype)
                full[ask] = values
                setattr(whole, name, full)
        return whole

    def _solve(self, path, setting, **options):
        return self.entrant.solve(path, self.problems.law, setting, self.seconds, self.folder, **options)

    def _same_bits(self, setting, answer):
        """(after permuting the environments, with 2 threads, with the code of an older processor): True, False, or None where
        there is nothing to compare."""
        if answer.late or answer.note:
            return None, None, None
        permuted = threads = None
        if self.problems.environments > 1:
            path = take(self.problems.path, self.order, self.folder / "permuted.h5")
            again = self._solve(path, setting, repeat=1)
            if not again.late:
                permuted = digest(restored(again.reaction, self.problems.offsets, self.order)) == digest(answer.reaction)
        if self.entrant.has_threads:
            again = self._solve(self.problems.path, setting, threads=2, repeat=1)
            threads = None if again.late else digest(again.reaction) == digest(answer.reaction)
        again = self._solve(self.problems.path, setting, repeat=1, older=True)
        machines = None if again.late or again.note else digest(again.reaction) == digest(answer.reaction)
        return permuted, threads, machines
