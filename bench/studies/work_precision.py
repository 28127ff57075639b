#!/usr/bin/env python3
"""Work-precision diagram: what residual is really reached, for how many microseconds of an environment.

    bench/studies/work_precision.py build/bin/stiction [--judge check_solution.py] [--data ../shared/data] [--quick]
                            [--results bench/results/MACHINE] [--images docs/images] [--scenes "G1,wall 5 x 5"]

Every scene is solved by every solver to tolerances 1e-1 ... 1e-10. That is in f64 under the file's law. Where the
scene is not large, it is also to 1e-6 in f32, and in f64 under the other law. Each answer is judged apart from the
solver. Writes work_precision.csv and work_precision.png. A solver's rows end where no environment reaches the
tolerance any more or where the command refuses. They also end where a batch takes more than --limit seconds of
processor time.
"""

import argparse
import pathlib
import sys
import tempfile

import measure
import numpy as np
import problems
from roster import SOLVERS
from table import read

COLUMNS = ["scene", "environments", "rows", "solver", "law", "precision", "tolerance", "residual_median", "residual_worst",
           "us_per_env", "iterations_median", "iterations_max", "unsolved", "repeats", "note"]
COLOURS = dict(zip(SOLVERS, ["tab:blue", "tab:cyan", "tab:pink", "tab:olive", "tab:gray", "tab:green", "tab:orange", "tab:red",
                             "tab:purple", "tab:brown", "black"], strict=True))
NO_FRICTION = {"column of 100"}  # where laws are the same, and which lemke takes as it is
LARGE = {"chain of 100 links", "wall 5 x 5"}  # in f64 under the file's law only: minutes for each solver
SLACK = 1.02


def scenes(bench, arguments):
    """(title, path, copies): recorded ones, generated ones, and a heavy cube on a light one by bench/studies/problems.py."""
    rng = np.random.default_rng(7)
    chosen = [("humanoid", measure.recorded(arguments, "mujoco/humanoid.h5", "humanoid.h5"), 8),
              ("G1", measure.recorded(arguments, "mujoco/g1.h5"), 4),
              ("LEAP hand", measure.recorded(arguments, "mujoco/leap_hand.h5", "hand_cube.h5"), 4)]
    if arguments.quick:
        chosen = chosen[:1]
    else:
        chosen += [("stack of 10", bench.generate("stack", 10, 4), 1),
                   ("chain of 100 links", bench.generate("chain", 100, 2), 1),
                   ("column of 100", bench.generate("column", 100, 4), 1),
                   ("wall 5 x 5", bench.generate("wall", 5, 2), 1)]
    heavy = problems.write(bench.folder / "mass_ratio_1000.h5", "coulomb", [problems.cubes([1, 1000], rng) for _ in range(16)])
    chosen.append(("mass ratio 1000", heavy, 1))
    return [(title, path, copies) for title, path, copies in chosen if path]


def ladder(bench, title, path, copies, solver, law, precision, tolerances):
    """Rows of the table, from the loosest tolerance on."""
    with measure.h5py.File(path) as batch:
        environments, rows = len(batch["env_row_ptr"]) - 1, len(batch["b"])
        law = law or measure.roster.law_of(batch)
    for tolerance in tolerances:
        row = dict.fromkeys(COLUMNS, "")
        row.update(scene=title, environments=environments, rows=rows, solver=solver, law=law, precision=precision,
                   tolerance=f"{tolerance:.0e}")
        found = bench.solve(path, solver, tolerance, law=law, precision=precision, copies=copies)
        if not found.answered:
            row["note"] = found.note
            yield row
            return
        row.update(residual_median=f"{found.median:.3e}", residual_worst=f"{found.worst:.3e}",
                   us_per_env=f"{found.microseconds:.4g}", iterations_median=int(np.median(found.iterations)),
                   iterations_max=int(found.iterations.max()), unsolved=found.unsolved, repeats=found.repeats)
        yield row
        if found.unsolved == environments:
            return


def sweep(bench, arguments):
    """The table, grown by one solver at a time."""
    tolerances = [10.0**-k for k in range(1, 11)][::3 if arguments.quick else 1]
    table = []
    for title, path, copies in scenes(bench, arguments):
        if arguments.scenes and title not in arguments.scenes.split(","):
            continue
        with measure.h5py.File(path) as batch:
            other = {"convex": "coulomb", "coulomb": "convex"}[measure.roster.law_of(batch)]
        runs = [(None, "f64", tolerances)]
        if title not in LARGE and not arguments.short:
            runs.append((None, "f32", [t for t in tolerances if t > 5e-7]))
        if title not in NO_FRICTION | LARGE and not arguments.short:
            runs.append((other, "f64", tolerances))
        for law, precision, wanted in runs:
            for solver in SOLVERS:
                if solver == "lemke" and title not in NO_FRICTION:
                    continue
                rows = list(ladder(bench, title, path, copies, solver, law, precision, wanted))
                table += rows
                last = rows[-1]
                print(f"{title:20} {solver:7} {last['law']:8} {precision} to {last['tolerance']}: {last['residual_worst']} "
                      f"{last['us_per_env']} us {last['note']}", file=sys.stderr, flush=True)
                yield table


def draw(table, path, machine):
    """Small multiples: the law of the file, f64 in lines, f32 in dots; the largest residual of any environment."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    titles = list(dict.fromkeys(row["scene"] for row in table))
    columns = min(4, len(titles))
    figure, axes = plt.subplots(-(-len(titles) // columns), columns, figsize=(4.1 * columns, 3.9 * -(-len(titles) // columns)),
                                squeeze=False, sharey=True)
    for axis in axes.flat[len(titles):]:
        axis.set_visible(False)
    handles = {}
    for axis, title in zip(axes.flat, titles):
        own = [row for row in table if row["scene"] == title and not row["note"]]
        law = own[0]["law"]  # that of the file comes first
        for solver in SOLVERS:
            for precision, line, width in (("f64", "-", 1.6), ("f32", ":", 1.2)):
                chosen = [row for row in own if (row["solver"], row["law"], row["precision"]) == (solver, law, precision)]
                points = [(float(row["us_per_env"]), max(float(row["residual_worst"]), 1e-16)) for row in chosen]
                if points:
                    drawn, = axis.plot(*zip(*points), line, color=COLOURS[solver], marker="o", markersize=3,
                                       linewidth=2.6 if (solver, precision) == ("auto", "f64") else width,
                                       zorder=1 if solver == "auto" else 2, alpha=0.5 if solver == "auto" else 1)
                    if precision == "f64":
                        handles.setdefault(solver, drawn)
        rows = int(own[0]["rows"]) / int(own[0]["environments"])
        axis.set(title=f"{title} ({law}, {rows:.0f} rows)", xscale="log", yscale="log", ylim=(1e-11, 1))
        axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("microseconds per environment")
    for row in axes:
        row[0].set_ylabel("largest residual of an environment")
    order = [solver for solver in SOLVERS if solver in handles]
    figure.legend([handles[solver] for solver in order], order, loc="lower center", ncol=len(order) if columns > 2 else 5, frameon=False,
                  bbox_to_anchor=(0.5, 0.02), fontsize=11)
    figure.text(0.5, 0.005, f"lines f64, dotted f32; one thread of {machine}, processor time, best of several runs", fontsize=9, ha="center")
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    measure.add_arguments(parser)
    parser.add_argument("--scenes", help="these alone, by title; the others' rows in the table are kept")
    parser.add_argument("--short", action="store_true", help="f64 under the file's law alone")
    parser.add_argument("--name", default="work_precision", help="of table and picture")
    parser.add_argument("--limit", type=float, default=3, help="processor seconds a batch may take")
    arguments = parser.parse_args()
    images = arguments.results if arguments.quick else arguments.images
    results, kept, table = arguments.results / f"{arguments.name}.csv", [], []
    if arguments.scenes and results.exists():
        kept = [row for row in read(results)[1] if row["scene"] not in arguments.scenes.split(",")]
    comments = measure.header(arguments.stiction, "studies/work_precision.py")
    with tempfile.TemporaryDirectory() as folder:
        bench = measure.Bench(arguments.stiction, arguments.judge, folder, 2 if arguments.quick else 3, arguments.limit)
        for table in sweep(bench, arguments):
            measure.write_table(results, comments, COLUMNS, kept + table)
    table = kept + table
    draw(table, images / f"{arguments.name}.png", measure.machine_name())


if __name__ == "__main__":
    main()
