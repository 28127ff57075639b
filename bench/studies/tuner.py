#!/usr/bin/env python3
"""A learned choice of solver measured against the single best one, `auto`, and the best of each batch.

    PYTHONPATH=build/python bench/studies/tuner.py [--csv FILE] [--data ../shared/data] [--seeds 10] [--decisions 480]

First every solver solves every batch (a recorded file, a law, a tolerance), the processor's time of one thread, least
of three. A batch is charged as TunedSolver charges: ten times the time for the share of environments that missed the
tolerance. Then choices are replayed on those costs: nothing of what follows depends on the clock any more. Batches are
drawn at random with equal probability, decision after decision. `learning` is what a training run pays, in passes of
--decisions each. `frozen` is a tuner that learned on half of the files and is held to the other half. Intervals:
bootstrap over seeds.
"""

import argparse
import csv
import pathlib
import time

import numpy as np

import stiction
from stiction.tuner import Tuner, features

ROOT = pathlib.Path(__file__).resolve().parents[2]
CHOICES = ["auto", "npgs", "pgs", "apgd", "nsgs", "admm", "newton", "ipm"]
TOLERANCES = (1e-3, 1e-6)
PASSES = 4
MOST_ROWS = 3000  # of all environments of a batch that is taken


def batches(folder):
    """(file, law, batch) of every recorded file that is small enough to be solved by everything."""
    for path in sorted(folder.rglob("*.h5")):
        if not {"mujoco", "coulomb", "sequences"} & {part.name for part in path.parents}:
            continue
        try:
            whole = stiction.Batch.from_file(path)
        except stiction.Error:
            continue
        if 0 < whole.rows <= MOST_ROWS:
            yield path.stem, whole.law, whole


def cost_of(batch, choice, tolerance):
    """Seconds of the processor as TunedSolver charges them, and the share that was solved."""
    solver = stiction.Solver(solver=choice, tolerance=tolerance, threads=1, max_iterations=2000)
    seconds, solved = [], 0.0
    for _ in range(3):
        start = time.process_time()
        solution = solver.solve(batch)
        seconds.append(time.process_time() - start)
        solved = float(np.mean(solution.solved))
    return max(min(seconds), 1e-6) * (1 + 9 * (1 - solved)), solved


def measure(folder):
    """(names, contexts, costs, solved), one row each for every batch and tolerance."""
    names, contexts, costs, solved = [], [], [], []
    for name, law, batch in batches(folder):
        for tolerance in TOLERANCES:
            pairs = [cost_of(batch, choice, tolerance) for choice in CHOICES]
            names.append((name, law, tolerance))
            contexts.append(features(batch, tolerance))
            costs.append([cost for cost, _ in pairs])
            solved.append([share for _, share in pairs])
            print(f"{name:<28} {law:<8} {tolerance:.0e} rows {batch.rows:>5}  best {CHOICES[int(np.argmin(costs[-1]))]}",
                  flush=True)
    return names, np.array(contexts), np.array(costs), np.array(solved)


def fresh():
    return Tuner(CHOICES, exploration=0.5)


def replay(tuner, contexts, costs, draws):
    """Costs of decisions on batches `draws`, in order."""
    paid = []
    for k in draws:
        choice = tuner.choose(contexts[k])
        paid.append(costs[k, choice])
        tuner.learn(contexts[k], choice, costs[k, choice])
    return np.array(paid)


def interval(values):
    rng = np.random.default_rng(0)
    means = [np.mean(rng.choice(values, len(values))) for _ in range(2000)]
    return np.mean(values), *np.percentile(means, (2.5, 97.5))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=pathlib.Path, default=ROOT.parent / "shared" / "data")
    parser.add_argument("--csv", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--decisions", type=int, default=480)
    arguments = parser.parse_args()
    if not arguments.data.is_dir():
        print(f"SKIPPED: {arguments.data} is not there")
        return
    names, contexts, costs, solved = measure(arguments.data)
    oracle = costs.min(axis=1)
    logs = np.log(costs / oracle[:, None])
    single = int(np.argmin(logs.mean(axis=0)))
    files = sorted({name for name, *_ in names})
    rows = []

    def add(way, per_seed):
        mean, low, high = interval(np.array(per_seed))
        rows.append({"way": way, "times_the_oracle": f"{mean:.3f}", "low": f"{low:.3f}", "high": f"{high:.3f}"})
        print(f"{way:<44} {mean:8.3f} times the oracle's cost, geometric mean [{low:.3f}, {high:.3f}]")

    for k, choice in enumerate(CHOICES):
        print(f"{choice:<10} {np.exp(logs[:, k].mean()):8.3f} times the oracle, solved {100 * solved[:, k].mean():.1f} %")
        rows.append({"way": f"always {choice}", "times_the_oracle": f"{np.exp(logs[:, k].mean()):.3f}", "low": "", "high": ""})
    learning, frozen, half_single, stops = [[] for _ in range(PASSES)], [], [], 0
    for seed in range(arguments.seeds):
        rng = np.random.default_rng(seed)
        tuner = fresh()
        for part in learning:
            draws = rng.integers(len(names), size=arguments.decisions)
            part.append(np.exp(np.mean(np.log(replay(tuner, contexts, costs, draws) / oracle[draws]))))
        stops += tuner.stopped is not None
        known = set(rng.permutation(files)[:len(files) // 2])
        seen = np.array([name in known for name, *_ in names])
        held, tuner = np.flatnonzero(~seen), fresh()
        replay(tuner, contexts, costs, rng.choice(np.flatnonzero(seen), PASSES * arguments.decisions))
        tuner.freeze()
        chosen = [tuner.choose(contexts[k]) for k in held]
        frozen.append(np.exp(logs[held, chosen].mean()))
        half_single.append(np.exp(logs[held, int(np.argmin(logs[seen].mean(axis=0)))].mean()))
    for number, part in enumerate(learning):
        add(f"learning, pass {number + 1} of {arguments.decisions} decisions", part)
    add("frozen, on files it has not seen", frozen)
    add("single best of the files it has seen, there", half_single)
    print(f"single best of all: {CHOICES[single]}; {len(names)} batches; the kill switch stopped {stops} of {arguments.seeds} runs")
    if arguments.csv:
        with open(arguments.csv, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, fieldnames=list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
