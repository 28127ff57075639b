"""stiction's solvers as entrants, through the command line."""

import dataclasses
import json
import os
import pathlib
import subprocess

import h5py
import numpy as np
import processes
from answer_file import Answer
from machine import OLDER

SPECTRUM = "by spectrum"  # the solver is chosen by condition and density, not named
BOXED = {"auto", SPECTRUM, "npgs", "pgs", "subspace", "nsgs"}  # those that take boxed friction
SOLVERS = ["auto", SPECTRUM, "npgs", "pgs", "subspace", "nsgs", "admm", "newton", "ipm", "lemke"]
ITERATIONS = 10000
TURNS, SHORT = 3, 0.1  # a solve shorter than that many seconds is done so many times more, and the shortest counts
STARTING = 1.0  # [s] that a process may take beside the solve


class Stiction:
    """One solver. It is given the goal as its tolerance, since it stops by the residual that the judge computes."""

    has_threads = True

    def __init__(self, program, solver, form="matrix"):
        self.program, self.solver, self.form = str(program), solver, form
        self.name = f"stiction {solver}" + (" (J, M)" if form == "jacobian" else "")
        self.given = "A" if form == "matrix" else "J and M"
        self.takes_boxes = solver in BOXED and form == "matrix"
        self.environment, self.idle = None, None

    def prepare(self, folder, clock):
        """None, or why it cannot run; `clock` are environment variables of a clock of processor time."""
        self.environment = clock
        info = json.loads(subprocess.run([self.program, "info", "--json"], capture_output=True, text=True, check=True).stdout)
        self.version = f"{info['version']}, epoch {info['epoch']}, {info['compiler']}"
        self.idle = self._idle(folder)

    def refuses(self, problems):
        if self.form == "jacobian" and not problems.has_jacobian:
            return "needs J and M, which the set does not have"
        if self.solver == "lemke" and problems.has_friction:
            return "solves complementarity problems; friction cones are none"
        return None

    def settings(self, goal):
        return [goal]

    def solve(self, path, law, setting, seconds, folder, threads=1, repeat=TURNS, older=False):
        environment = {**(self.environment or os.environ), **OLDER} if older else self.environment
        report, solution, notes = (pathlib.Path(folder, name) for name in ("report.json", "solution.h5", "notes"))
        notes.unlink(missing_ok=True)
        with h5py.File(path) as batch:
            rows, count = len(batch["b"]), len(batch["env_row_ptr"]) - 1
        limit = seconds * count
        late = Answer(np.full(rows, np.nan), claimed=np.zeros(count, bool), late=True, note=f"no answer in {limit:g} s")

        def call(turns):
            """(exit status, stderr, seconds of the shortest turn)."""
            chosen = ["--choose", "spectrum"] if self.solver == SPECTRUM else ["--solver", self.solver]
            command = [self.program, "solve", path, *chosen, "--law", law, "--precision", "f64", "--form", self.form,
                       "--tolerance", repr(setting), "--max-iterations", ITERATIONS, "--threads", threads, "--repeat", turns,
                       "--isolate", "--device", "cpu", "--quiet", "-o", solution, "--json", report]
            done = processes.run(processes.weighed(command, notes, limit + STARTING), limit + STARTING, environment)
            return *done, json.loads(report.read_text())["seconds"]["solve"] if done[0] in (0, 1) else None

        status, message, spent = call(1)
        if status is None or (spent is not None and spent > limit):
            return late
        if status not in (0, 1):
            return dataclasses.replace(late, late=False, note=processes.last_line(message))
        if repeat > 1 and spent < SHORT:
            spent = min(spent, call(repeat)[2] or np.inf)
        with h5py.File(solution) as file:
            iterations, codes, reaction = file["iterations"][:], file["status"][:], file["lambda"][:].astype(float)
        share = (iterations + 1.0) * self._entries(path)
        weight = processes.peak(notes)
        return Answer(reaction, spent * share / share.sum(), codes == 0, iterations,
                      None if weight is None or self.idle is None else max(0.0, weight - self.idle))

    @staticmethod
    def _entries(path):
        """Stored entries of each environment, by which a call's time is shared out beside the iterations."""
        with h5py.File(path) as batch:
            return np.diff(batch["A/ptr"][:][batch["env_row_ptr"][:]]) + 1

    def _idle(self, folder):
        """Peak [MiB] of the program when it has next to nothing to do."""
        notes, least = pathlib.Path(folder, "idle"), pathlib.Path(folder, "least.h5")
        subprocess.run([self.program, "generate", "column", "--size", "1", "--envs", "1", "--seed", "1", "--quiet", "-o", str(least)],
                       check=True)
        notes.unlink(missing_ok=True)
        processes.run(processes.weighed([self.program, "solve", least, "--quiet", "--threads", "1", "--device", "cpu"], notes), 10)
        return processes.peak(notes)


def entrants(program):
    return [Stiction(program, solver) for solver in SOLVERS] + [Stiction(program, "auto", "jacobian")]
