#!/usr/bin/env python3
"""What every solver reaches on recorded contact problems, by a judge of one's own choice: a table and performance profiles.

    bench/studies/roster.py build/bin/stiction FOLDER_OR_FILE ... [--judge tools/check_law.py]
                    [--results DIR] [--profiles PNG] [--solvers npgs,newton,...] [--max-iterations 10000] [--timeout 20]
                    [--goals f64:1e-3,f64:1e-6,f64:1e-8,f32:1e-3] [--profiled f64:1e-6] [--name roster]

Each file is solved by each solver to each goal, on one thread. An environment is solved if the judge's residual is
within the tolerance. Writes roster.csv (a row for each file, solver and goal) and roster.md (shares of environments)
into DIR, or what --name says. For the goals in --profiled it writes the profiles of Dolan and More (2002). They give
the share of environments that a solver solves within a multiple of the time of the fastest one. A file's time is
shared out over its environments by their iterations. What is not answered within the timeout counts as unsolved.
"""

import argparse
import csv
import importlib.util
import json
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np

SOLVERS = ["pgs", "npgs", "subspace", "nsgs", "jacobi", "apgd", "admm", "newton", "ipm", "lemke", "auto"]
GOALS, PROFILED = "f64:1e-3,f64:1e-6,f64:1e-8,f32:1e-3", "f64:1e-6"
# The judge reads the numbers as written; the solver's residual is the same up to rounding.
SLACK = 1.02
COLUMNS = ["file", "solver", "precision", "tolerance", "environments", "solved", "claimed", "iterations_median", "iterations_p95",
           "us_per_env", "note"]


JUDGE = pathlib.Path(__file__).resolve().parents[2] / "tools" / "check_law.py"


def load_judge(path=JUDGE):
    spec = importlib.util.spec_from_file_location("judge", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.residuals


def files_of(arguments):
    for name in arguments:
        path = pathlib.Path(name)
        yield from sorted(path.glob("*.h5")) if path.is_dir() else [path]


def law_of(batch):
    law = batch.attrs.get("law", "convex")
    return law.decode() if isinstance(law, bytes) else law


def run(arguments, judge, path, solver, precision, tolerance):
    """(row of the table, estimated microseconds of each environment, infinite where it is unsolved)."""
    with h5py.File(path) as batch, tempfile.TemporaryDirectory() as folder:
        count = len(batch["env_row_ptr"]) - 1
        row = dict.fromkeys(COLUMNS, "")
        row.update(file=f"{path.parent.name}/{path.stem}", solver=solver, precision=precision, tolerance=tolerance,
                   environments=count, solved=0)
        times = np.full(count, np.inf)
        report, answer = pathlib.Path(folder, "report.json"), pathlib.Path(folder, "answer.h5")
        command = [arguments.stiction, "solve", str(path), "--solver", solver, "--precision", precision, "--tolerance",
                   str(tolerance), "--max-iterations", str(arguments.max_iterations), "--threads", "1", "--quiet",
                   "--isolate", "-o", str(answer), "--json", str(report)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=arguments.timeout)
        except subprocess.TimeoutExpired:
            row["note"] = f"no answer in {arguments.timeout:g} s"
            return row, times
        if done.returncode > 1:
            row["note"] = done.stderr.strip().split("\n")[0][:80]
            return row, times
        with h5py.File(answer) as solution:
            residual = judge(batch, solution["lambda"][:].astype("f8"), law_of(batch))
            iterations = solution["iterations"][:].astype("f8")
        solved = residual <= SLACK * tolerance
        summary = json.loads(report.read_text())
        microseconds = summary["seconds"]["solve"] * 1e6
        share = (iterations + 1) / (iterations + 1).sum()
        times[solved] = (microseconds * share)[solved]
        row.update(solved=int(solved.sum()), claimed=count - summary["unconverged"],
                   iterations_median=int(np.median(iterations)), iterations_p95=int(np.quantile(iterations, 0.95)),
                   us_per_env=round(microseconds / count, 2))
        return row, times


def write_table(rows, path):
    """Shares of environments by folder, solver and goal."""
    folders = list(dict.fromkeys(row["file"].split("/")[0] for row in rows))
    goals = list(dict.fromkeys((row["precision"], row["tolerance"]) for row in rows))
    lines = []
    for folder in folders:
        total = sum(row["environments"] for row in rows if row["file"].startswith(folder + "/")
                    and row["solver"] == rows[0]["solver"] and (row["precision"], row["tolerance"]) == goals[0])
        lines += [f"### {folder}, {total} environments", "",
                  "| solver | " + " | ".join(f"{precision} {tolerance:g}" for precision, tolerance in goals) + " |",
                  "|---|" + "---|" * len(goals)]
        for solver in dict.fromkeys(row["solver"] for row in rows):
            cells = []
            for precision, tolerance in goals:
                own = [row for row in rows if row["file"].startswith(folder + "/") and row["solver"] == solver
                       and row["precision"] == precision and row["tolerance"] == tolerance]
                solved = sum(row["solved"] for row in own)
                late = sum("no answer" in row["note"] for row in own)
                cells.append(f"{solved} ({100 * solved / total:.0f} %)" + (f", {late} files late" if late else ""))
            lines.append(f"| `{solver}` | " + " | ".join(cells) + " |")
        lines.append("")
    path.write_text("\n".join(lines))


def draw_profiles(profiled, path):
    """profiled: (precision, tolerance) -> solver -> microseconds of every environment."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = min(2, len(profiled))
    lines = -(-len(profiled) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(8 * columns, 5 * lines), squeeze=False)
    ratios = np.logspace(0, 4, 200)
    for axis, ((precision, tolerance), times) in zip(axes.flat, profiled.items()):
        best = np.min(list(times.values()), axis=0)
        for solver, own in times.items():
            ratio = np.full(len(own), np.inf)
            np.divide(own, best, out=ratio, where=np.isfinite(own))
            axis.step(ratios, [(ratio <= r).mean() for r in ratios], where="post", label=solver,
                      linewidth=3 if solver == "auto" else 1.5)
        axis.set(xscale="log", xlabel="time over the fastest solver's", ylabel="share of environments solved", ylim=(0, 1),
                 title=f"{len(best)} recorded environments, {precision}, relative residual {tolerance:g}, one thread")
        axis.grid(alpha=0.3)
        axis.legend(ncol=2)
    figure.tight_layout()
    figure.savefig(path, dpi=120)


def goals_of(text):
    return [(precision, float(tolerance)) for precision, tolerance in (part.split(":") for part in text.split(","))]


def write(arguments, rows, times):
    with open(arguments.results / f"{arguments.name}.csv", "w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    write_table(rows, arguments.results / f"{arguments.name}.md")
    if arguments.profiles:
        draw_profiles({goal: {solver: np.concatenate(own) for solver, own in found.items()} for goal, found in times.items()},
                      arguments.profiles)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("batches", nargs="+")
    parser.add_argument("--judge", default=JUDGE)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--profiles", type=pathlib.Path)
    parser.add_argument("--solvers", default=",".join(SOLVERS))
    parser.add_argument("--max-iterations", type=int, default=10000)
    parser.add_argument("--timeout", type=float, default=20)
    parser.add_argument("--goals", type=goals_of, default=GOALS)
    parser.add_argument("--profiled", type=goals_of, default=PROFILED)
    parser.add_argument("--name", default="roster")
    arguments = parser.parse_args()
    judge = load_judge(arguments.judge)
    solvers = arguments.solvers.split(",")
    rows, times = [], {goal: {solver: [] for solver in solvers} for goal in arguments.profiled}
    for path in files_of(arguments.batches):
        for solver in solvers:
            for precision, tolerance in arguments.goals:
                row, own = run(arguments, judge, path, solver, precision, tolerance)
                rows.append(row)
                if (precision, tolerance) in times:
                    times[precision, tolerance][solver].append(own)
                print("{file:26} {solver:7} {precision} {tolerance:<6g} {solved:4} of {environments:<4} {us_per_env} us  {note}"
                      .format(**row), file=sys.stderr, flush=True)
        write(arguments, rows, times)


if __name__ == "__main__":
    main()
