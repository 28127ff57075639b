#!/usr/bin/env python3
"""What every solver costs on every case of choice_cases.py: the data that choice_table.py is trained on.

    PYTHONPATH=build/python bench/studies/choice_measure.py OUT.csv [--data ../shared/data] [--stiction PROGRAM]

A line is a case at a tolerance, with its features. Of each solver it has microseconds of the processor for an
environment, the share of environments within the tolerance, and iterations. bench/arena/judge.py judges. One thread,
double precision, A given. Times are the least of several calls, because the machine may be shared. A solver that takes
longer than --limit, and `auto` one of ten times that, is ended and has solved nothing. Lines of OUT.csv are kept.
"""

import argparse
import csv
import multiprocessing
import os
import pathlib
import sys
import tempfile
import time

import numpy as np
from choice_cases import FEATURES, cases, features

import stiction

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench" / "arena"))
import judge  # noqa: E402 - after the path

#: Solvers, and the most iterations that are given to each: a factorisation costs in the order of rows sweeps.
SOLVERS = {"auto": 4096, "npgs": 4096, "pgs": 4096, "subspace": 4096, "nsgs": 4096, "apgd": 4096, "admm": 4096,
           "newton": 200, "ipm": 200, "lemke": 4096}
TOLERANCES = (1e-4, 1e-6)
BUDGET, MOST_REPEATS = 0.03, 7  # [s] for repeats of a call


def measure(case, solver, tolerance):
    """(microseconds of an environment, share that is solved, mean iterations)"""
    run = stiction.Solver(solver=solver, tolerance=tolerance, max_iterations=SOLVERS[solver], threads=1)
    seconds, spent = [], 0.0
    while not seconds or spent < (10 * BUDGET if len(seconds) == 1 else BUDGET) and len(seconds) < MOST_REPEATS:
        start = time.process_time()
        solution = run.solve(case.batch)
        seconds.append(time.process_time() - start)
        spent += seconds[-1]
    residual = judge.residuals(case.judged(), solution.lambda_[:len(case.arrays["b"])], case.law)
    return (min(seconds) * 1e6 / (case.count * case.copies), float(np.mean(residual <= judge.SLACK * tolerance)),
            float(np.mean(solution.iterations)))


def serve(pipe, folder, arguments):
    """Measures what it is asked for; cases are made again in the process, so that one can be ended."""
    known = list(cases(arguments.data, arguments.stiction, folder))
    pipe.send("ready")
    while True:
        number, solver, tolerance = pipe.recv()
        try:
            pipe.send(measure(known[number], solver, tolerance))
        except stiction.Error as error:
            pipe.send(str(error))


def seconds_of(process):
    """Of the processor, that a process has taken."""
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Worker:
    """A process that measures, ended and begun anew where it takes too long."""

    def __init__(self, folder, arguments):
        self.folder, self.arguments, self.process = folder, arguments, None

    def ask(self, case, *question):
        """What measure() says of a case, a solver and a tolerance. `auto` tries several solvers: it has more time."""
        limit = self.arguments.limit * (10 if question[1] == "auto" else 1)
        if self.process is None:
            self.pipe, other = multiprocessing.Pipe()
            self.process = multiprocessing.Process(target=serve, args=(other, self.folder, self.arguments), daemon=True)
            self.process.start()
            self.pipe.recv()  # ready
        begun = seconds_of(self.process)
        self.pipe.send(question)
        while not self.pipe.poll(0.5):
            if seconds_of(self.process) - begun > limit:
                self.process.kill()
                self.process = None
                return limit * 1e6 / (case.count * case.copies), 0.0, np.nan
        return self.pipe.recv()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("csv", type=pathlib.Path)
    parser.add_argument("--data", type=pathlib.Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--stiction", default=str(ROOT / "build" / "bin" / "stiction"))
    parser.add_argument("--limit", type=float, default=3.0, help="seconds of the processor for a solver on a case")
    arguments = parser.parse_args()
    if not arguments.data.is_dir():
        print(f"SKIPPED: {arguments.data} is not there")
        return
    done = set()
    if arguments.csv.exists():
        with open(arguments.csv, newline="", encoding="utf-8") as file:
            done = {(line["case"], float(line["digits"])) for line in csv.DictReader(file)}
    with tempfile.TemporaryDirectory() as folder, open(arguments.csv, "a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if not done:
            writer.writerow(["family", "case", *FEATURES, *(f"{solver}_{what}" for solver in SOLVERS
                                                             for what in ("us", "solved", "iterations"))])
        worker = Worker(folder, arguments)
        known = list(cases(arguments.data, arguments.stiction, folder))
        for number, case in sorted(enumerate(known), key=lambda pair: len(pair[1].batch.arrays["A"])):
            for tolerance in TOLERANCES:
                if (case.name, round(-np.log10(tolerance), 6)) in done:
                    continue
                found = []
                for solver in SOLVERS:
                    answer = worker.ask(case, number, solver, tolerance)
                    if isinstance(answer, str):
                        print(f"{case.name} {solver}: {answer}", flush=True)
                        answer = (np.nan, 0.0, np.nan)
                    found += [f"{answer[0]:.4g}", f"{answer[1]:.3g}", f"{answer[2]:.4g}"]
                writer.writerow([case.family, case.name, *(f"{x:.4g}" for x in features(case, tolerance)), *found])
                file.flush()
                times = {solver: float(us) for solver, us, solved in zip(SOLVERS, found[::3], found[1::3])
                         if solved == "1"}
                best = min(times, key=times.get, default="none")
                print(f"{case.name:<24} {tolerance:.0e} best {best:<9} {times.get(best, np.nan):10.1f} us, auto "
                      f"{float(found[0]):10.1f} us, solved {float(found[1]):.2f}", flush=True)


if __name__ == "__main__":
    main()
