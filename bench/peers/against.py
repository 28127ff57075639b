#!/usr/bin/env python3
"""stiction against solvers of others on recorded problems: which solver solves what, to which residual, in what time.

    bench/peers/against.py build/bin/stiction FOLDER_OR_FILE ... [--judge tools/check_law.py] --results DIR
                           [--goals 1e-4,1e-6,1e-8] [--seconds 2] [--only stiction,siconos,clarabel]
                           [--solvers npgs,auto] [--laws file]

Siconos (apt install libsiconos-numerics-dev, and a C compiler) answers friction under Coulomb's law and LCPs. Clarabel
(pip install clarabel scipy) answers the convex law. Files of Coulomb's law are solved under both. Under the convex one
A is (A + A')/2, since no minimum knows more of it. A peer that is not installed is left out. An environment is solved
if the judge's residual is within the goal; no solver's own claim counts. The judge measures reactions in units of w by
the mean diagonal of A + R, which hides them where that is not positive. Rows of such LCPs must keep abs(min(s lambda,
w)) within the goal as well, s the largest entry of the row. Writes against.csv (a row for each file, law, solver and
goal) and against.md into DIR.

Rules. One thread. stiction is given the goal as its tolerance; SOLVER/apart is that solver with every island separate
(--islands apart), which no peer has. The peers stop by their own measures. A peer that claims a solution that the
judge does not accept runs again. It gets tolerances 100, 10000, ... times smaller, down to 1e-16, and only the run
with the best answer is timed. Every solver has the same seconds for each environment. stiction, which gets a file as
one batch, has at first 10 seconds for it. If that is not enough, each environment runs in a separate process.
Iterations: 10000 for stiction, 100000 for Siconos, 200 for Clarabel. A solver that was late for a goal does not run
for a smaller one.

Times are those of the solving call, without reading and writing. stiction's is the report's; it is shared out over the
file's environments by iterations and stored entries, since packs of environments are solved at once. Siconos and
Clarabel solve one after the other. Of short calls the shortest of up to three counts; of long ones wall clock or
processor time, whichever is less.
"""

import argparse
import csv
import json
import os
import pathlib
import platform
import resource
import subprocess
import sys
import tempfile

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "studies")]

import siconos  # noqa: E402
from environments import FRICTION, UNILATERAL, read_environments, write_batch  # noqa: E402
from roster import JUDGE, SLACK, files_of, law_of, load_judge  # noqa: E402

try:
    import conic
except ImportError:
    conic = None

STICTION = ["nsgs", "npgs", "admm", "newton", "ipm", "lemke", "auto"]
STICTION_ITERATIONS, SICONOS_ITERATIONS = 10000, 100000
FILE_SECONDS = 10
TIGHTER, LEAST_TOLERANCE = [1, 1e-2, 1e-4, 1e-6, 1e-8], 1e-16
COLUMNS = ["file", "law", "solver", "goal", "environments", "solved", "claimed", "late", "residual_median", "residual_worst",
           "ms_median", "ms_total"]


class Answer:
    """What one solver says about one environment."""

    def __init__(self, reaction=None, seconds=np.inf, claimed=False, late=False):
        self.reaction, self.seconds, self.claimed, self.late = reaction, seconds, claimed, late


class Stiction:
    ladder = [1]

    def __init__(self, program, entry):
        self.solver, _, self.islands = entry.partition("/")
        self.program, self.name = program, f"stiction {entry}"

    def call(self, path, law, goal, seconds, folder, repeat=1):
        """(report, solution's arrays), or None when time ran out."""
        report, answer = pathlib.Path(folder, "report.json"), pathlib.Path(folder, "answer.h5")
        command = [self.program, "solve", str(path), "--solver", self.solver, "--law", law, "--precision", "f64", "--tolerance",
                   repr(goal), "--max-iterations", str(STICTION_ITERATIONS), "--threads", "1", "--quiet", "--isolate",
                   "--repeat", str(repeat), "--islands", self.islands or "together",
                   "-o", str(answer), "--json", str(report)]
        limit = int(np.ceil(seconds))
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=4 * limit,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1)))
        except subprocess.TimeoutExpired:
            return None
        if done.returncode < 0:
            return None
        if done.returncode > 1:
            raise RuntimeError(f"{' '.join(command)}: exit status {done.returncode}, {done.stderr.strip()}")
        with h5py.File(answer) as solution:
            return json.loads(report.read_text()), {name: solution[name][:] for name in ("lambda", "status", "iterations")}

    def timed(self, path, law, goal, seconds, folder):
        """The answer with the least time of up to three, of short solves in one process, as the peers' are."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        first = self.call(path, law, goal, seconds, folder)
        if first is None:
            return None
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        least = first[0]["seconds"]["solve"]
        if least > 0.1:
            least = min(least, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        if least < 5e-3:
            again = self.call(path, law, goal, seconds, folder, repeat=3)
            least = min(least, again[0]["seconds"]["solve"] if again else np.inf)
        return first[1], least

    def solve(self, environments, law, goal, seconds, folder):
        path = pathlib.Path(folder, "batch.h5")
        write_batch(path, environments, law, "against.py")
        done = self.timed(path, law, goal, min(seconds * len(environments), FILE_SECONDS), folder)
        if done is None:
            if len(environments) == 1 and seconds <= FILE_SECONDS:
                return [Answer(seconds=seconds, late=True)]
            return [self.solve([e], law, goal, seconds, folder)[0] for e in environments]
        solution, spent = done
        work = (solution["iterations"] + 1.0) * np.array([len(e.values) + 1 for e in environments])
        ends = np.cumsum([e.rows for e in environments])
        return [Answer(solution["lambda"][end - e.rows:end], spent * share, code == 0)
                for e, end, share, code in zip(environments, ends, work / work.sum(), solution["status"])]


class Siconos:
    ladder = TIGHTER

    def __init__(self, program, solver, size):
        self.program, self.solver, self.size, self.name = program, solver, size, f"Siconos {solver}"

    def solve(self, environments, law, goal, seconds, folder):
        answers = siconos.solve(self.program, environments, self.size, self.solver, goal, SICONOS_ITERATIONS, seconds, folder)
        return [Answer(reaction if np.isfinite(reaction).all() else None, spent, how == 0, how == siconos.LATE)
                for reaction, spent, how in answers]


class Clarabel:
    ladder = TIGHTER
    name = "Clarabel"

    def solve(self, environments, law, goal, seconds, folder):
        answers = []
        for e in environments:
            reaction, spent, claimed = conic.solve(e, goal, seconds)
            for _ in range(2 if spent < 5e-3 else 0):
                spent = min(spent, conic.solve(e, goal, seconds)[1])
            answers.append(Answer(reaction if np.isfinite(reaction).all() else None, spent, claimed, spent > seconds))
        return answers


def batches(arguments, folder):
    """Contact batches, and FCLIB files made into them; what the command line refuses is left out."""
    names = [file for name in arguments.batches for file in (sorted(pathlib.Path(name).glob("*.hdf5")) or [name])]
    for path in files_of(names):
        if path.suffix == ".hdf5":
            batch = pathlib.Path(folder, path.parent.name, path.stem + ".h5")
            batch.parent.mkdir(exist_ok=True)
            done = subprocess.run([arguments.stiction, "convert", str(path), str(batch)], capture_output=True, text=True)
            if done.returncode:
                print(f"left out: {path.name}: {done.stderr.strip()}", file=sys.stderr)
                continue
            path = batch
        yield path


def entrants(arguments, program, environments, law):
    friction = any((e.kinds == FRICTION).any() for e in environments)
    if "stiction" in arguments.only:
        yield from (Stiction(arguments.stiction, solver) for solver in arguments.solvers.split(",")
                    if not (friction and solver == "lemke"))
    size = siconos.contact_size(environments, law)
    if program and size:
        yield from (Siconos(program, solver, size) for solver in siconos.SOLVERS[size])
    if conic and "clarabel" in arguments.only and law == "convex":
        yield Clarabel()


def hidden_residual(environment, reaction):
    """Of an LCP's rows without a positive diagonal, over max|b|."""
    offsets, columns, values = environment.with_compliance()
    here = np.repeat(np.arange(environment.rows), np.diff(offsets))
    diagonal = np.bincount(here, values * (columns == here), environment.rows)
    hidden = (diagonal <= 0) & (environment.row_kinds == UNILATERAL)
    if not hidden.any() or not np.isfinite(reaction).all():
        return 0.0
    largest = np.zeros(environment.rows)
    np.maximum.at(largest, here, np.abs(values))
    motion = environment.b + np.bincount(here, values * reaction[columns], environment.rows)
    gap = np.abs(np.minimum(np.where(largest > 0, largest, 1) * reaction, motion))
    return gap[hidden].max() / max(np.abs(environment.b).max(), 1e-300)


class Course:
    """One solver, one file, one law: goal after goal."""

    def __init__(self, entrant, judge, path, law, environments, arguments):
        self.entrant, self.judge, self.path, self.law = entrant, judge, path, law
        self.environments, self.arguments = environments, arguments
        self.late = np.zeros(len(environments), bool)

    def residuals(self, answers):
        rows = [np.full(e.rows, np.nan) if a is None or a.reaction is None else a.reaction
                for e, a in zip(self.environments, answers)]
        with h5py.File(self.path) as batch:
            judged = self.judge(batch, np.concatenate(rows), self.law)
        return np.maximum(judged, [hidden_residual(e, reaction) for e, reaction in zip(self.environments, rows)])

    def run(self, goal):
        answers = [None] * len(self.environments)
        ask, residual = np.flatnonzero(~self.late), self.residuals(answers)
        for factor in self.entrant.ladder:
            if not len(ask) or (factor < 1 and goal * factor < LEAST_TOLERANCE):
                break
            with tempfile.TemporaryDirectory() as folder:
                said = self.entrant.solve([self.environments[i] for i in ask], self.law, goal * factor, self.arguments.seconds,
                                          folder)
            tried = list(answers)
            for i, answer in zip(ask, said):
                tried[i] = answer
            new = self.residuals(tried)
            for i, answer in zip(ask, said):
                if answers[i] is None or new[i] < residual[i]:
                    answers[i], residual[i] = answer, new[i]
            ask = np.array([i for i, answer in zip(ask, said) if answer.claimed and residual[i] > SLACK * goal], int)
        self.late |= [bool(a and a.late) for a in answers]
        solved = residual <= SLACK * goal
        seconds = np.array([self.arguments.seconds if a is None else a.seconds for a in answers])
        return dict(file=f"{self.path.parent.name}/{self.path.stem}", law=self.law, solver=self.entrant.name, goal=goal,
                    environments=len(answers), solved=int(solved.sum()), claimed=sum(bool(a and a.claimed) for a in answers),
                    late=int(self.late.sum()), ms_total=round(1e3 * seconds.sum(), 4),
                    residual=residual, seconds=np.where(solved, seconds, np.inf))


def label(goal):
    return f"{goal:.0e}".replace("e-0", "e-")


def number(value, form):
    return format(value, form) if np.isfinite(value) else "-"


def milliseconds(value):
    return number(value, ".3g") if value < 1000 else number(value, ".0f")


def family_table(rows, goals):
    lines = ["| solver | " + " | ".join(f"solved at {label(goal)}, ms" for goal in goals) + " | residual at "
             f"{label(goals[-1])}: median, worst |", "|---|" + "---|" * (len(goals) + 1)]
    for solver in dict.fromkeys(row["solver"] for row in rows):
        own = [row for row in rows if row["solver"] == solver]
        cells, total = [], sum(row["environments"] for row in own if row["goal"] == goals[0])
        for goal in goals:
            at = [row for row in own if row["goal"] == goal]
            solved = sum(row["solved"] for row in at)
            middle = np.quantile(np.concatenate([row["seconds"] for row in at]), 0.5, method="higher")
            cells.append(f"{solved} of {total} ({100 * solved / total:.0f} %), {milliseconds(1e3 * middle)}")
        residual = np.concatenate([row["residual"] for row in own if row["goal"] == goals[-1]])
        cells.append(f"{number(np.quantile(residual, 0.5, method='higher'), '.1e')}, {number(residual.max(), '.1e')}")
        lines.append(f"| {solver} | " + " | ".join(cells) + " |")
    return lines


def winners_table(rows, goals):
    lines = ["| file | " + " | ".join(f"{label(goal)}: best of stiction; best of the others" for goal in goals) + " |",
             "|---|" + "---|" * len(goals)]
    wins = {goal: [0, 0] for goal in goals}
    for name in dict.fromkeys(row["file"] for row in rows):
        cells = []
        for goal in goals:
            at = [row for row in rows if row["file"] == name and row["goal"] == goal]
            best = [min((row for row in at if row["solver"].startswith("stiction") is ours), default=None,
                        key=lambda row: (-row["solved"], row["ms_total"])) for ours in (True, False)]
            said = ["-" if row is None or not row["solved"] else f"{row['solver']} {row['solved']}/{row['environments']}, "
                    f"{milliseconds(row['ms_total'])} ms" for row in best]
            if None not in best and any(row["solved"] for row in best):
                first = min((0, 1), key=lambda i: (-best[i]["solved"], best[i]["ms_total"]))
                wins[goal][first] += 1
                said[first] = f"**{said[first]}**"
            cells.append("; ".join(said).replace("stiction ", ""))
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    lines.append("| files won | " + " | ".join(f"stiction {ours}; others {others}" for ours, others in wins.values()) + " |")
    return lines


def write_table(rows, path):
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n", extrasaction="ignore")
        table.writeheader()
        for row in rows:
            table.writerow(row | {"residual_median": number(np.quantile(row["residual"], 0.5, method="higher"), ".2e"),
                                  "residual_worst": number(row["residual"].max(), ".2e"),
                                  "ms_median": number(1e3 * np.quantile(row["seconds"], 0.5, method="higher"), ".4g")})


def write_report(rows, goals, head, path):
    lines = head
    for folder, law in dict.fromkeys((row["file"].split("/")[0], row["law"]) for row in rows):
        own = [row for row in rows if row["file"].startswith(folder + "/") and row["law"] == law]
        lines += ["", f"## {folder}, law {law}", "", *family_table(own, goals), "", *winners_table(own, goals)]
    path.write_text("\n".join(lines) + "\n")


def head_of(arguments, program):
    model = [line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")][:1]
    ours = subprocess.run([arguments.stiction, "--version"], capture_output=True, text=True).stdout.strip()
    peers = [siconos.version() if program else "no Siconos", conic.VERSION if conic else "no Clarabel"]
    return ["# stiction against solvers of others", "",
            f"`bench/peers/against.py` with {arguments.seconds:g} s for each environment; {ours}, {', '.join(peers)}; "
            f"{(model or [platform.processor()])[0]}, one thread. The machine was shared, so times carry noise: of short calls the "
            "shortest of up to three counts, of long ones the smaller of wall clock and processor time.", "",
            "Solved is what the judge accepts. ms in the first table: the median of an environment's time, unsolved ones taking "
            "for ever (-: more than half are unsolved). In the second: the whole file, unsolved environments and all; more "
            "solved wins, then less time; - : nothing solved. A residual of - : no answer in time."]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("batches", nargs="+")
    parser.add_argument("--judge", default=JUDGE)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--goals", default="1e-4,1e-6,1e-8")
    parser.add_argument("--seconds", type=float, default=2)
    parser.add_argument("--only", default="stiction,siconos,clarabel")
    parser.add_argument("--solvers", default=",".join(STICTION), help="of stiction")
    parser.add_argument("--laws", default="both", choices=["both", "file"])
    arguments = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    judge, goals = load_judge(arguments.judge), sorted(map(float, arguments.goals.split(",")), reverse=True)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        program = siconos.build(folder) if "siconos" in arguments.only else None
        for path in batches(arguments, folder):
            environments = read_environments(path)
            with h5py.File(path) as batch:
                laws = [law_of(batch)]
            if arguments.laws == "both" and laws == ["coulomb"] and any((e.kinds == FRICTION).any() for e in environments):
                laws.append("convex")
            for law in laws:
                if law != laws[0]:
                    environments = [e.symmetric() if e.rows else e for e in environments]
                    path = pathlib.Path(folder, "symmetric", path.parent.name, path.name)
                    path.parent.mkdir(parents=True, exist_ok=True)
                    write_batch(path, environments, law, "symmetric part")
                for entrant in entrants(arguments, program, environments, law):
                    course = Course(entrant, judge, path, law, environments, arguments)
                    for goal in goals:
                        rows.append(course.run(goal))
                        print("{file:22} {law:7} {solver:15} {goal:<6g} {solved:3} of {environments:<3} late {late:<3} "
                              "{ms_total} ms".format(**rows[-1]), file=sys.stderr, flush=True)
            write_table(rows, arguments.results / "against.csv")
            write_report(rows, goals, head_of(arguments, program), arguments.results / "against.md")


if __name__ == "__main__":
    main()
