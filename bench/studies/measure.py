"""Runs of the command line on contact batches, timed and judged: what work_precision.py and engines.py share."""

import csv
import dataclasses
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

import h5py
import numpy as np
import roster

ROOT = pathlib.Path(__file__).resolve().parents[2]


@dataclasses.dataclass
class Outcome:
    """What one solver did on one batch. Residuals are the judge's; without a judge `verify` gives median and worst."""

    note: str = ""  # why there is no answer; empty if there is one
    median: float = np.inf
    worst: float = np.inf
    residual: np.ndarray = None  # of each environment; without a judge the status records'
    iterations: np.ndarray = None
    lam: np.ndarray = None  # reactions, all environments
    w: np.ndarray = None
    microseconds: float = np.inf  # of the call, for each environment, best of `repeats`
    repeats: int = 0
    unsolved: int = 0

    @property
    def answered(self):
        return not self.note


class Bench:
    def __init__(self, stiction, judge, folder, repeats=5, timeout=10):
        self.stiction, self.folder = str(stiction), pathlib.Path(folder)
        self.judge = roster.load_judge(judge) if judge else None
        self.repeats, self.timeout = repeats, timeout  # [s] of processor time
        self.environment = {**os.environ, **processor_clock(self.folder)}
        self.budget = 0.6  # [s]: a run that takes longer is not repeated

    def generate(self, scene, size, environments, seed=7):
        path = self.folder / f"{scene}_{size}_{environments}.h5"
        if not path.exists():
            subprocess.run([self.stiction, "generate", scene, "--envs", str(environments), "--seed", str(seed), "--size",
                            str(size), "--quiet", "-o", str(path)], check=True, capture_output=True)
        return path

    def solve(self, path, solver, tolerance=0.0, iterations=100000, law="file", precision="f64", copies=1, repeats=None,
              options=()):
        """Solves the batch at `path`, repeated `copies` times in one call; everything but the time is the first copy's."""
        answer, report = self.folder / "answer.h5", self.folder / "report.json"
        command = [self.stiction, "solve", str(tiled(path, copies, self.folder)), "--solver", solver, "--precision", precision,
                   "--law", law, "--tolerance", repr(tolerance), "--max-iterations", str(iterations), "--threads", "1",
                   "--quiet", "--json", str(report), *options]
        outcome = Outcome()
        seconds, spent = [], 0.0
        while len(seconds) < (repeats or self.repeats) and spent <= self.budget:
            status, message = run(command if seconds else [*command, "-o", str(answer)], self.environment, self.timeout)
            if status is None:
                return Outcome(note=f"no answer in {self.timeout:g} s")
            if status not in (0, 1):
                return Outcome(note=(message.strip().split("\n")[0] or f"exit status {status}")[:90])
            summary = json.loads(report.read_text())
            seconds.append(summary["seconds"]["solve"])
            spent += seconds[-1]
            if len(seconds) == 1:
                self._read(outcome, path, answer, law)
        outcome.microseconds = min(seconds) * 1e6 / summary["environments"]
        outcome.repeats = len(seconds)
        return outcome

    def _read(self, outcome, path, answer, law):
        with h5py.File(path) as batch, h5py.File(answer) as solution:
            rows, environments = len(batch["b"]), len(batch["env_row_ptr"]) - 1
            outcome.lam = solution["lambda"][:rows].astype("f8")
            outcome.w = solution["w"][:rows].astype("f8")
            outcome.iterations = solution["iterations"][:environments].astype("i8")
            outcome.unsolved = int((solution["status"][:environments] != 0).sum())
            law = roster.law_of(batch) if law == "file" else law
            if self.judge:
                outcome.residual = self.judge(batch, outcome.lam, law)
                outcome.median, outcome.worst = float(np.median(outcome.residual)), float(outcome.residual.max())
                return
            outcome.residual = solution["residual"][:environments].astype("f8")
        only = self.folder / "first_copy.h5"
        with h5py.File(only, "w") as file:
            file["lambda"] = outcome.lam
        done = subprocess.run([self.stiction, "verify", str(path), str(only), "--law", law, "--json"], capture_output=True,
                              text=True)
        found = json.loads(done.stdout)["residual"]
        outcome.median, outcome.worst = found["median"], found["max"]


def run(command, environment, limit):
    """(exit status, or None after more than `limit` seconds of processor time; what was written to stderr)."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)
    start = time.monotonic()
    while True:
        try:
            message = process.communicate(timeout=0.2)[1]
            return process.returncode, message
        except subprocess.TimeoutExpired:
            if processor_seconds(process.pid, time.monotonic() - start) > limit:
                process.kill()
                process.communicate()
                return None, ""


def processor_seconds(process, elapsed):
    """What the process has used so far, or the time elapsed where the system does not say. A limit set on the process itself
    (RLIMIT_CPU) makes Linux read the processor clock in ticks of 4 ms."""
    try:
        fields = pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError):
        return elapsed


CLOCK = """
#define _GNU_SOURCE
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
int clock_gettime(clockid_t clock, struct timespec* now) {
  return (int)syscall(SYS_clock_gettime, clock == CLOCK_MONOTONIC ? CLOCK_PROCESS_CPUTIME_ID : clock, now);
}
"""


def processor_clock(folder):
    """Environment variables under which the command line's clock is its own processor time, so that other programs'
    turns do not count. There are none (the wall clock) where there is no C compiler or no preloading."""
    source, library = pathlib.Path(folder) / "clock.c", pathlib.Path(folder) / "clock.so"
    source.write_text(CLOCK)
    built = shutil.which("cc") and sys.platform == "linux" and subprocess.run(
        ["cc", "-O2", "-shared", "-fPIC", str(source), "-o", str(library)], capture_output=True).returncode == 0
    if not built:
        print("no C compiler: times are wall-clock", file=sys.stderr)
    return {"LD_PRELOAD": str(library)} if built else {}


def tiled(path, copies, folder):
    """The batch with its environments repeated, so that a call is long enough for the clock and for full packs."""
    if copies == 1:
        return path
    target = pathlib.Path(folder) / f"{pathlib.Path(path).stem}_times_{copies}.h5"
    if target.exists():
        return target
    with h5py.File(path) as batch, h5py.File(target, "w") as out:
        out.attrs.update(batch.attrs)
        for name in ("env_row_ptr", "env_cone_ptr", "cone_row_ptr", "A/ptr"):
            pointer = batch[name][:]
            steps = np.tile(np.diff(pointer), copies)
            out[name] = np.concatenate(([0], np.cumsum(steps))).astype(pointer.dtype)
        for name in ("cone_kind", "row_param", "A/col", "A/val", "b", "R"):
            out[name] = np.tile(batch[name][:], copies)
    return target


def add_arguments(parser):
    parser.add_argument("stiction", help="the command line")
    parser.add_argument("--judge", help="check_solution.py or another module with residuals(batch, lam, law); default: verify")
    parser.add_argument("--data", type=pathlib.Path, default=ROOT.parent / "shared" / "data",
                        help="folder of recorded batches; what is not there is taken from examples/data or left out")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "bench" / "results" / machine_name())
    parser.add_argument("--images", type=pathlib.Path, default=ROOT / "docs" / "images")
    parser.add_argument("--quick", action="store_true", help="few points, to see that it runs; pictures go beside the tables")


def recorded(arguments, name, example=None):
    """A recorded batch, or the example that stands in for it, or None."""
    for path in (arguments.data / name, ROOT / "examples" / "data" / (example or "none")):
        if path.is_file():
            return path
    print(f"{name}: not there, left out", file=sys.stderr)
    return None


def machine_name():
    """As in run.sh: the environment's MACHINE, else processor and cores."""
    if os.environ.get("MACHINE"):
        return os.environ["MACHINE"]
    text = pathlib.Path("/proc/cpuinfo").read_text() if pathlib.Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"^model name[^:]*: (.*)$", text, re.M)
    number = re.search(r"^model\s*: (.*)$", text, re.M)
    cores = len(re.findall(r"^processor\s*:", text, re.M)) or 1
    name = f"{model.group(1) if model else 'unknown'} model {number.group(1) if number else ''} {cores} cores"
    return re.sub(r"[^a-z0-9]+", "-", re.sub(r"\([A-Za-z]*\)", "", name).lower()).strip("-")


def header(stiction, script):
    """Comment lines that say what made a table, and where."""
    info = json.loads(subprocess.run([stiction, "info", "--json"], capture_output=True, text=True, check=True).stdout)
    commit = subprocess.run(["git", "-C", str(ROOT), "describe", "--always", "--dirty"], capture_output=True, text=True)
    return [f"bench/{script}", f"machine: {machine_name()}", f"devices: {json.dumps(info.get('devices'))}",
            f"compiler: {json.dumps(info.get('compiler'))}", f"commit: {commit.stdout.strip()}",
            "one thread; times are processor time, the best of several runs on a machine that others used"]


def write_table(path, comments, columns, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        file.writelines(f"# {comment}\n" for comment in comments)
        table = csv.DictWriter(file, columns, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
