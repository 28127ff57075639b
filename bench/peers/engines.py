#!/usr/bin/env python3
"""stiction against the solvers inside physics engines: Bullet, DART and ODE, each on problems under its law.

    bench/peers/engines.py build/bin/stiction --data FOLDER [--judge tools/check_law.py] --results DIR [--passes 4]
                           [--goal 1e-6] [--only lcp,pyramids,boxed,sweeps]

Needs any of libbullet-dev, libdart-dev, libode-dev, with pkg-config and a C++ compiler; one that is missing is left
out. FOLDER holds recorded batches (lcp/, coulomb/, mujoco/); scenes come from `stiction generate`. Writes engines.csv
and engines.md into DIR.

Three races to a residual of --goal, on problems that both sides solve under the same law:
  lcp       recorded linear complementarity problems as they are;
  pyramids  friction as pyramids of four edges under the convex law: symmetric LCPs (docs/pyramid.md);
  boxed     friction as engines have it (boxed.py). stiction's sweeps take it as it is, its lemke the LCP with the same
            solutions, five rows a contact.
and one comparison of sweeps, 20 and 60 of them: time for a contact and a sweep, and the residual, each in its own law.

Rules. One thread; every answer is judged by boxed.residual in f64, LCPs by the judge as well (the larger counts).
Iterative engines get the fewest of 10, 15, 22, ... 9000 iterations with which an environment is solved; stiction gets
the tolerance. Its residual of boxed friction has another norm than the judge's. So there the tolerance is the largest
of 1, 1/2, 1/4 and 1/8 of the goal with which an environment is solved. Of a first pass nothing is timed. Then all run one after the other, and again in reverse order (A B B
A), --passes in all, on the environments that they solved. A ratio is an engine's time over stiction's in one pass on
one environment that both solve. stiction's is that of its solver that solves most, then takes least. stiction's time
is its report's in processor time, over the copies of the environment that the call was given, up to 64. An engine's is
its solving call alone, the median of warm calls. What it forms before and after is listed apart.
"""

import argparse
import csv
import dataclasses
import functools
import json
import os
import pathlib
import resource
import sys
import tempfile

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "studies")]

import boxed  # noqa: E402
import engine_programs as programs  # noqa: E402
import measure  # noqa: E402
import rigid  # noqa: E402
import sweeps  # noqa: E402
from against import hidden_residual  # noqa: E402
from environments import read_environments, write_batch  # noqa: E402
from roster import JUDGE, load_judge  # noqa: E402

SLACK = 1.02
RUNGS = [10, 15, 22, 33, 50, 75, 110, 160, 240, 360, 540, 800, 1200, 1800, 2700, 4000, 6000, 9000]
PIVOTS = [1000]
SHARES = [1, 0.5, 0.25, 0.125]
CALL_SECONDS = 0.02  # of stiction, by copies; of an engine in one pass, by calls, a quarter of it
MATRIX_ENGINES = [("Bullet f64", "dantzig", PIVOTS), ("Bullet f64", "pgs", RUNGS), ("DART", "dantzig", PIVOTS),
                  ("DART", "dantzig_cfm", PIVOTS), ("DART", "pgs", RUNGS)]
LCP_ENGINES = MATRIX_ENGINES + [("Bullet f64", "lemke", PIVOTS), ("DART", "lemke", PIVOTS)]
SCENE_ENGINES = [("Bullet f64", "si", RUNGS), ("ODE", "step", PIVOTS), ("ODE", "quick", RUNGS)]
COLUMNS = ["race", "file", "solver", "environments", "solved_1e-4", "solved", "claimed", "iterations", "residual_median",
           "residual_worst", "us", "us_forming", "against", "common", "ratio_q1", "ratio", "ratio_q3"]


@dataclasses.dataclass
class Problem:
    given: boxed.Boxed  # what engines solve, and what judges
    environment: object  # what stiction solves: half lines
    back: np.ndarray = None  # from stiction's reaction to the engines'; None: they are the same
    scene: rigid.Scene = None
    cones: object = None  # the contacts as stiction would have them, under Coulomb's law


@dataclasses.dataclass
class Answer:
    reaction: np.ndarray
    residual: float
    claimed: bool
    rung: float  # iterations given to an engine, share of the goal to stiction


class Engine:
    def __init__(self, name, program, solver, rungs, in_scene):
        self.name, self.program, self.solver, self.rungs, self.in_scene = f"{name} {solver}", program, solver, rungs, in_scene

    def ask(self, problems, which, rung, seconds, folder):
        records = [problems[i].scene.records() if self.in_scene else programs.boxed_records(problems[i].given) for i in which]
        path = programs.write(pathlib.Path(folder, "problems.bin"), records)
        return programs.solve(self.program, self.solver, rung, seconds, path, [len(problems[i].given.b) for i in which], folder)

    def answers(self, race):
        """The first rung that solves, of each problem; without one the best."""
        best = [Answer(None, np.inf, False, self.rungs[0]) for _ in race.problems]
        ask = list(range(len(race.problems)))
        for rung in self.rungs:
            for i, (reaction, _, _, how) in zip(ask, self.ask(race.problems, ask, rung, 0.0, race.folder)) if ask else []:
                residual = race.residual(i, reaction)
                if best[i].reaction is None or residual < best[i].residual:
                    best[i] = Answer(reaction, residual, how == programs.SOLVED, rung)
            ask = [i for i in ask if best[i].residual > SLACK * race.goal]
        return best

    def times(self, race, solved, answers):
        """Problem to (seconds of solving, of forming)."""
        found = {}
        for rung in {answers[i].rung for i in solved}:
            which = [i for i in solved if answers[i].rung == rung]
            for i, (_, solving, forming, _) in zip(which, self.ask(race.problems, which, rung, CALL_SECONDS / 4, race.folder)):
                found[i] = solving, forming
        return found


class Stiction:
    def __init__(self, program, solver, clock, in_cones=False, in_boxes=False):
        self.program, self.solver, self.clock, self.in_cones, self.in_boxes = program, solver, clock, in_cones, in_boxes
        self.name = f"stiction {solver}" + (", cones" if in_cones else ", boxes" if in_boxes else "")
        self.copies = {}

    def call(self, race, i, copies, share, answer=None):
        """Seconds of the call. share: of the goal, that is the tolerance."""
        path = pathlib.Path(race.folder, f"{self.name}_{i}_{copies}.h5")
        problem = race.problems[i]
        if not path.exists():
            environment = problem.cones if self.in_cones else problem.environment
            if self.in_boxes:
                environment = boxed.in_boxes(problem.cones)
            write_batch(path, [environment] * copies, "coulomb" if self.in_cones else "convex", "engines.py")
        report = pathlib.Path(race.folder, "report.json")
        command = [self.program, "solve", str(path), "--solver", self.solver, "--precision", "f64", "--tolerance", repr(share * race.goal),
                   "--max-iterations", "10000", "--threads", "1", "--quiet", "--isolate", "--json", str(report)]
        status, message = measure.run(command + (["-o", str(answer)] if answer else []), {**os.environ, **self.clock}, 5)
        if status is None:
            return np.inf
        if status > 1:
            raise RuntimeError(f"{' '.join(command)}: {message}")
        return json.loads(report.read_text())["seconds"]["solve"]

    def answers(self, race):
        """With the largest share that solves, of each problem; without one the best."""
        found = []
        for i in range(len(race.problems)):
            best = Answer(None, np.inf, False, 1)
            for share in SHARES if self.in_boxes else SHARES[:1]:
                answer = self.answer(race, i, share)
                if answer.residual < best.residual:
                    best = answer
                if best.residual <= SLACK * race.goal:
                    break
            found.append(best)
        return found

    def answer(self, race, i, share):
        path, problem = pathlib.Path(race.folder, "answer.h5"), race.problems[i]
        seconds = self.call(race, i, 1, share, path)
        if not np.isfinite(seconds):
            return Answer(None, np.inf, False, share)
        self.copies[i] = int(np.clip(CALL_SECONDS / seconds, 1, 64))
        with h5py.File(path) as solution:
            reaction, claimed = solution["lambda"][:].astype("f8"), solution["status"][0] == 0
        if self.in_cones:
            return Answer(reaction, race.cone_residual(i, reaction), bool(claimed), share)
        reaction = reaction if problem.back is None or self.in_boxes else problem.back @ reaction
        return Answer(reaction, race.residual(i, reaction), bool(claimed), share)

    def times(self, race, solved, answers):
        return {i: (self.call(race, i, self.copies[i], answers[i].rung) / self.copies[i], 0.0) for i in solved}


class Race:
    """One file, one law: which solver solves what, and in what time."""

    def __init__(self, kind, name, problems, judge, goal, folder):
        self.kind, self.name, self.problems, self.judge, self.goal = kind, name, problems, judge, goal
        self.folder = pathlib.Path(folder, f"{kind}_{name}".replace("/", "_").replace(" ", "_"))
        self.folder.mkdir()

    def judged(self, environment, reaction, law):
        path = self.folder / "judged.h5"
        write_batch(path, [environment], law, "engines.py")
        with h5py.File(path) as batch:
            return float(self.judge(batch, reaction, law)[0])

    def residual(self, i, reaction):
        if not np.isfinite(reaction).all():
            return np.inf
        problem = self.problems[i]
        own = boxed.residual(problem.given, reaction)
        if problem.back is not None:
            return own
        return max(own, self.judged(problem.environment, reaction, "convex"), hidden_residual(problem.environment, reaction))

    def cone_residual(self, i, reaction):
        return self.judged(self.problems[i].cones, reaction, "coulomb")

    def run(self, entrants, passes):
        answers = {entrant: entrant.answers(self) for entrant in entrants}
        solved = {entrant: [i for i, answer in enumerate(own) if answer.residual <= SLACK * self.goal]
                  for entrant, own in answers.items()}
        times = {entrant: [] for entrant in entrants}
        for one in range(passes):
            for entrant in entrants[::-1] if one % 2 else entrants:
                times[entrant].append(entrant.times(self, solved[entrant], answers[entrant]) if solved[entrant] else {})
        typical = {entrant: {i: np.median([one[i] for one in times[entrant]], axis=0) for i in solved[entrant]}
                   for entrant in entrants}
        ours = [entrant for entrant in entrants if isinstance(entrant, Stiction) and not entrant.in_cones]
        best = min(ours, key=lambda entrant: (-len(solved[entrant]), sum(t[0] for t in typical[entrant].values())))
        return [self.row(entrant, answers[entrant], solved, typical[entrant], times, best) for entrant in entrants]

    def row(self, entrant, answers, solved, typical, times, best):
        residual = np.array([answer.residual for answer in answers])
        row = dict(race=self.kind, file=self.name, solver=entrant.name, environments=len(answers), solved=len(solved[entrant]),
                   claimed=sum(answer.claimed for answer in answers), residual_median=short(np.median(residual)),
                   residual_worst=short(residual.max()))
        row["solved_1e-4"] = int((residual <= SLACK * 1e-4).sum())
        if typical:
            solving, forming = np.median(list(typical.values()), axis=0)
            row.update(us=short(1e6 * solving), us_forming=short(1e6 * forming))
            if isinstance(entrant, Engine):
                row["iterations"] = int(np.median([answers[i].rung for i in typical])) if len(entrant.rungs) > 1 else ""
        common = [i for i in solved[entrant] if i in solved[best]]
        if isinstance(entrant, Engine) and common:
            ratios = [one[i][0] / other[i][0] for one, other in zip(times[entrant], times[best]) for i in common]
            row.update(zip(("ratio_q1", "ratio", "ratio_q3"), map(short, np.quantile(ratios, (0.25, 0.5, 0.75)))),
                       against=best.name, common=len(common))
        return row


def short(value):
    return f"{value:.3g}"


def scenes(bench, kind, size, count):
    return rigid.read_scenes(bench.generate(kind, size, count))


def friction_files(bench, data):
    """(name, problems' cones, scenes or None) for the two races with friction."""
    for kind, size, count in (("stack", 2, 8), ("stack", 5, 2), ("pile", 20, 4)):
        found = scenes(bench, kind, size, count)
        yield f"{kind} {size}", [scene.environment() for scene in found], found
    for name, count in (("coulomb/rover", 14), ("coulomb/contactbench", 21), ("mujoco/humanoid", 16), ("mujoco/franka_cube", 8)):
        if (data / f"{name}.h5").is_file():
            yield name, read_environments(data / f"{name}.h5")[:count], None


def races(bench, built, arguments, judge):
    """(race, entrants)"""
    ours = functools.partial(Stiction, arguments.stiction, clock=measure.processor_clock(bench.folder))

    def engines(which, in_scene):
        return [Engine(name, built[name], solver, rungs, in_scene) for name, solver, rungs in which if name in built]

    if "lcp" in arguments.only:
        for path in sorted(arguments.data.glob("lcp/*.h5")):
            if not path.stem.endswith("_unsolved"):
                problems = [Problem(boxed.plain(e), e) for e in read_environments(path) if e.rows <= arguments.rows]
                yield (Race("lcp", f"lcp/{path.stem}", problems, judge, arguments.goal, bench.folder),
                       [ours(solver) for solver in ("lemke", "auto")] + engines(LCP_ENGINES, False))
    for name, cones, found in friction_files(bench, arguments.data):
        if "pyramids" in arguments.only:
            problems = [Problem(boxed.plain(e), e) for e in map(boxed.edges, cones)]
            yield (Race("pyramids", name, problems, judge, arguments.goal, bench.folder),
                   [ours(solver) for solver in ("lemke", "npgs", "auto")] + engines(LCP_ENGINES, False))
        if "boxed" in arguments.only:
            problems = []
            for i, e in enumerate(cones):
                given = boxed.of_environment(e)
                problems.append(Problem(given, *boxed.as_lcp(given), scene=found[i] if found else None, cones=e))
            yield (Race("boxed", name, problems, judge, arguments.goal, bench.folder),
                   [ours("lemke"), ours("npgs", in_boxes=True), ours("auto", in_boxes=True), ours("npgs", in_cones=True)]
                   + engines(MATRIX_ENGINES, False)
                   + (engines(SCENE_ENGINES, True) if found else []))


def race_table(rows):
    lines = ["| file | solver | solved, of | at 1e-4 | claimed | residual: median, worst | us | us forming | times stiction's: "
             "median (quartiles), environments |", "|---|---|---|---|---|---|---|---|---|"]
    for row in rows:
        get = {column: row.get(column, "") for column in COLUMNS}
        ratio = "{ratio} ({ratio_q1}-{ratio_q3}), {common} of {against}".format(**get) if get["ratio"] else ""
        lines.append("| {file} | {solver} | {solved}, {environments} | {solved_1e-4} | {claimed} | {residual_median}, "
                     "{residual_worst} | {us} | {us_forming} | ".format(**get) + ratio.replace("of stiction", "against") + " |")
    return lines


def write_report(path, head, rows, swept):
    titles = {"lcp": "Recorded LCPs", "pyramids": "Pyramids of four edges, convex law", "boxed": "Boxed friction"}
    lines = ["# stiction against the solvers inside physics engines", ""] + [f"- {line}" for line in head]
    for kind, title in titles.items():
        own = [row for row in rows if row["race"] == kind]
        if own:
            lines += ["", f"## {title}", "", *race_table(own)]
    if swept:
        lines += ["", "## Sweeps", "", *sweeps.table(swept)]
    path.write_text("\n".join(lines) + "\n")


def processor_seconds():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("--data", type=pathlib.Path, default=measure.ROOT.parent / "shared" / "data")
    parser.add_argument("--judge", default=JUDGE)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--passes", type=int, default=4)
    parser.add_argument("--goal", type=float, default=1e-6)
    parser.add_argument("--rows", type=int, default=150, help="LCPs of more rows are left out")
    parser.add_argument("--only", default="lcp,pyramids,boxed,sweeps")
    arguments = parser.parse_args()
    arguments.only = arguments.only.split(",")
    np.seterr(over="ignore", invalid="ignore")  # engines return numbers of any size; what they leave is judged
    load, rows, swept = os.getloadavg()[0], [], []
    arguments.results.mkdir(parents=True, exist_ok=True)

    def write(built):
        head = measure.header(arguments.stiction, "peers/engines.py")[:-1] + [
            ", ".join(map(programs.version, built)) or "no engine was found",
            f"residual {arguments.goal:g}, {arguments.passes} passes on one thread; load of the machine when it began {load:.1f}, when it ended "
            f"{os.getloadavg()[0]:.1f}; {processor_seconds():.0f} s of processor time, compilers included"]
        measure.write_table(arguments.results / "engines.csv", head, COLUMNS, rows)
        if swept:
            measure.write_table(arguments.results / "engines_sweeps.csv", head, sweeps.COLUMNS, swept)
        write_report(arguments.results / "engines.md", head, rows, swept)

    with tempfile.TemporaryDirectory() as folder:
        bench, judge = measure.Bench(arguments.stiction, None, folder), load_judge(arguments.judge)
        built = {name: program for name in programs.PROGRAMS if (program := programs.build(name, folder))}
        for race, entrants in races(bench, built, arguments, judge):
            rows += race.run(entrants, arguments.passes)
            write(built)
            print(f"{race.kind} {race.name}: {processor_seconds():.0f} s of processor time so far", file=sys.stderr, flush=True)
        if "sweeps" in arguments.only:
            for scene in sweeps.SCENES:
                swept += sweeps.compare(bench, built, arguments.stiction, scene, arguments.passes, judge)
                write(built)
            swept += sweeps.baselines(bench, arguments.stiction)
            write(built)


if __name__ == "__main__":
    main()
