"""Runs of the command line on contact batches, timed and judged: what work_precision.py and chapter_claims.py share."""

import csv
import dataclasses
import json
import pathlib
import re
import subprocess
import sys

import h5py
import numpy as np
import roster

ROOT = pathlib.Path(__file__).resolve().parent.parent


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
    microseconds: float = np.inf  # of the whole call, for each environment, best of `repeats`
    repeats: int = 0
    unsolved: int = 0

    @property
    def answered(self):
        return not self.note


class Bench:
    def __init__(self, stiction, judge, folder, repeats=5, timeout=8.0):
        self.stiction, self.folder = str(stiction), pathlib.Path(folder)
        self.judge = roster.load_judge(judge) if judge else None
        self.repeats, self.timeout = repeats, timeout
        self.budget = 1.0  # [s]: a run that takes longer is not repeated

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
            try:
                done = subprocess.run(command if seconds else [*command, "-o", str(answer)], capture_output=True, text=True,
                                      timeout=self.timeout)
            except subprocess.TimeoutExpired:
                return Outcome(note=f"no answer in {self.timeout:g} s")
            if done.returncode not in (0, 1):
                return Outcome(note=(done.stderr.strip().split("\n")[0] or f"exit status {done.returncode}")[:90])
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
    """As in run.sh: processor and cores."""
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
            "one thread; times are the best of several runs on a machine that others used"]


def write_table(path, comments, columns, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        file.writelines(f"# {comment}\n" for comment in comments)
        table = csv.DictWriter(file, columns, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
