#!/usr/bin/env python3
"""The comparisons again on problems that are new: every scene of `stiction generate` from a seed drawn now.

    bench/peers/fresh.py STICTION --judge check_solution.py [--results DIR] [--bench-ratio build/bench/bench_ratio]
                         [--seed S] [--envs 8] [--seconds 0.3]

Runs bench_ratio (stiction, a naive loop, Eigen) on scenes of the seed and of the one behind the committed tables. Runs
against.py (auto and npgs, Siconos and Clarabel where they are installed) on the fresh ones. Writes fresh/ratio.csv,
fresh/against.csv, fresh/against.md and fresh.md, which has both seeds' ratios side by side.
"""

import argparse
import csv
import importlib.util
import pathlib
import secrets
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "studies")]

import measure  # noqa: E402
from table import read  # noqa: E402

COMMITTED_SEED = 7
SIZES = {"stack": 4, "wall": 3, "pyramid": 2, "pile": 30, "chain": 12, "column": 20, "grasp": 0, "walker": 0, "mixed": 40,
         "adversarial": 4}
GOALS = ("1e-4", "1e-6")


def ratios(program, seed, folder):
    """Rows of bench_ratio for that seed; times naive's is in whole_median and sweeps_median."""
    path = pathlib.Path(folder, f"ratio_{seed}.csv")
    subprocess.run([program, "--contacts", "4,8,22", "--envs", "1024", "--precision", "f32", "--repeats", "5", "--seed",
                    str(seed), "--csv", str(path)], check=True, stdout=subprocess.DEVNULL)
    return [row | {"seed": seed} for row in read(path)[1]]


def ratio_lines(rows, seed):
    heads = [f"sweeps, {one} | whole, {one}" for one in (COMMITTED_SEED, seed)]
    lines = ["", "## Against a naive loop and Eigen", "", "Times as fast as the naive loop, f32, median (quartiles): the "
             f"sweeps, and the whole call of 20 sweeps, with scenes of seed {COMMITTED_SEED} and of seed {seed}.", "",
             f"| family, contacts | implementation | {' | '.join(heads)} |", "|---" * 6 + "|"]
    where = {(row["family"], row["contacts"], row["implementation"], row["flags"], row["seed"]): row for row in rows}
    for family, contacts, implementation, flags, own in where:
        if own != seed or implementation.startswith("naive"):
            continue
        cells = []
        for one in (COMMITTED_SEED, seed):
            row = where[family, contacts, implementation, flags, one]
            cells += [f"{row[kind + '_median']} ({row[kind + '_q1']}-{row[kind + '_q3']})" for kind in ("sweeps", "whole")]
        name = implementation if implementation.startswith("stiction") else f"{implementation} {flags}"
        lines.append(f"| {family}, {contacts} | {name} | " + " | ".join(cells) + " |")
    return lines


def against_lines(rows):
    """Per scene, law and goal: solved, and whole files' times of the best of ours and of others."""
    heads = [f"{goal}: stiction | others | ratio" for goal in GOALS]
    lines = ["", "## Against Siconos and Clarabel", "", "Best of stiction's `auto` and `npgs` (solved, ms for the file) and "
             "best of the others, and the others' time over stiction's where as many are solved.", "",
             f"| scene, law | {' | '.join(heads)} |", "|---" * (1 + 3 * len(GOALS)) + "|"]
    for name, law in dict.fromkeys((row["file"], row["law"]) for row in rows):
        cells = []
        for goal in GOALS:
            own = [row for row in rows if (row["file"], row["law"], float(row["goal"])) == (name, law, float(goal))]
            best = [min((row for row in own if row["solver"].startswith("stiction") is ours), default=None,
                        key=lambda row: (-int(row["solved"]), float(row["ms_total"]))) for ours in (True, False)]
            cells += ["-" if row is None else f"{row['solver'].replace('stiction ', '')} {row['solved']}/"
                      f"{row['environments']}, {float(row['ms_total']):.3g}" for row in best]
            equal = None not in best and best[0]["solved"] == best[1]["solved"] != "0"
            cells.append(f"{float(best[1]['ms_total']) / float(best[0]['ms_total']):.2f}" if equal else "-")
        lines.append(f"| {name.split('/')[-1]}, {law} | " + " | ".join(cells) + " |")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("--judge", required=True)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--bench-ratio", help="left out without it")
    parser.add_argument("--seed", type=int, default=None, help="default: drawn")
    parser.add_argument("--envs", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=0.3, help="as against.py's")
    arguments = parser.parse_args()
    seed = secrets.randbelow(10**6) + 1000 if arguments.seed is None else arguments.seed
    results = arguments.results / "fresh"
    results.mkdir(parents=True, exist_ok=True)
    lines = ["# On scenes of a fresh seed", "", f"`bench/peers/fresh.py --seed {seed}`; {measure.machine_name()}, one thread."]
    with tempfile.TemporaryDirectory() as folder:
        if arguments.bench_ratio:
            rows = ratios(arguments.bench_ratio, COMMITTED_SEED, folder) + ratios(arguments.bench_ratio, seed, folder)
            comments = measure.header(arguments.stiction, "peers/fresh.py")
            measure.write_table(results / "ratio.csv", comments, list(rows[0]), rows)
            lines += ratio_lines(rows, seed)
        scenes = pathlib.Path(folder, f"seed_{seed}")
        scenes.mkdir()
        for scene, size in SIZES.items():
            subprocess.run([arguments.stiction, "generate", scene, "--size", str(size), "--envs", str(arguments.envs),
                            "--seed", str(seed), "-o", str(scenes / f"{scene}.h5"), "--quiet"], check=True)
        laws = "both" if importlib.util.find_spec("clarabel") else "file"  # no other peer knows the convex law
        subprocess.run([sys.executable, str(HERE / "against.py"), arguments.stiction, str(scenes), "--judge", arguments.judge,
                        "--results", str(results), "--goals", ",".join(GOALS), "--seconds", str(arguments.seconds),
                        "--solvers", "auto,npgs", "--laws", laws], check=True)
    with open(results / "against.csv", encoding="utf-8") as file:
        lines += against_lines(list(csv.DictReader(file)))
    (arguments.results / "fresh.md").write_text("\n".join(lines) + "\n")
    print(f"seed {seed}: {arguments.results / 'fresh.md'}")


if __name__ == "__main__":
    main()
