#!/usr/bin/env python3
"""One training with coarse, fine and rising accuracy of the contacts: return against time.

    examples/python/04_adaptive_accuracy.py [--task HalfCheetah] [--steps 200000] [--csv FILE] [--picture FILE.png]
    examples/python/04_adaptive_accuracy.py --only coarse --csv coarse.csv      # one of them
    examples/python/04_adaptive_accuracy.py --draw coarse.csv fine.csv --picture FILE.png

coarse: 5 iterations or 1e-2; fine: 1e-6; curriculum: 5 / 1e-2, from progress 0.3 on 10 / 1e-3, from 0.7 on
20 / 1e-4. Each policy is judged at the end with contacts solved to 1e-8, whatever it was trained with. Time is the
processor's, of all threads, so that other work on the machine does not count.
"""

import argparse
import csv

import training
from stiction import AccuracyPolicy

POLICIES = {"coarse": AccuracyPolicy.fixed(1e-2, 5), "fine": AccuracyPolicy.fixed(1e-6, 1000),
            "curriculum": AccuracyPolicy.curriculum()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="HalfCheetah")
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--envs", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--csv")
    parser.add_argument("--picture")
    parser.add_argument("--only", choices=POLICIES, help="train with this accuracy alone")
    parser.add_argument("--draw", nargs="+", metavar="CSV", help="train nothing, draw what these files hold")
    options = parser.parse_args()
    rows = []
    for path in options.draw or []:
        with open(path, encoding="utf-8") as file:
            rows += list(csv.DictReader(file))
    chosen = [] if options.draw else [options.only] if options.only else list(POLICIES)
    for name in chosen:
        accuracy = POLICIES[name]
        found, model, normalised = training.train(options.task, options.steps, options.envs, options.seed, accuracy)
        score = round(training.evaluate(options.task, model, normalised), 1)
        rows += [{"accuracy": name} | row | {"evaluated": score} for row in found]
        solver = sum(row["solver_seconds"] for row in found)
        print(f"{name}: {found[-1]['cpu_seconds']:.0f} s of the processor; solver {solver:.1f} s of the wall; "
              f"evaluated {score}", flush=True)
        if options.csv:
            training.write(options.csv, rows)
    if options.picture:
        draw(rows, options)


def draw(rows, options):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (by_time, by_steps) = pyplot.subplots(1, 2, figsize=(9, 3.5), sharey=True)
    for name in POLICIES:
        mine = [row for row in rows if row["accuracy"] == name]
        returns = [float(row["return_per_1000_steps"]) for row in mine]
        by_time.plot([float(row["cpu_seconds"]) for row in mine], returns, label=name)
        by_steps.plot([int(row["steps"]) / 1000 for row in mine], returns, label=name)
    by_time.set(xlabel="processor time [s]", ylabel="reward per 1000 steps", title=f"PPO, {options.task}")
    by_steps.set(xlabel="environment steps [thousands]")
    for axes in (by_time, by_steps):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.tight_layout()
    figure.savefig(options.picture, dpi=110)


if __name__ == "__main__":
    main()
