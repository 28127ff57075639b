#!/usr/bin/env python3
"""Draw rewards of trainings against control steps and processor time, from files of examples/python/14_quadruped.py --csv.

    bench/studies/curves.py lanes=LANES.csv mujoco=MUJOCO.csv -o docs/images/training_go1.png --title "Go1"
"""

import argparse
import csv

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  the backend has to be chosen first


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("curves", nargs="+", metavar="NAME=FILE.csv")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--title")
    options = parser.parse_args()
    figure, (by_steps, by_time) = plt.subplots(1, 2, figsize=(9, 3.5), sharey=True)
    for name, path in (curve.split("=", 1) for curve in options.curves):
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        rewards = [float(row["reward"]) for row in rows]
        by_steps.plot([int(row["steps"]) / 1e6 for row in rows], rewards, label=name)
        by_time.plot([float(row["cpu_seconds"]) for row in rows], rewards, label=name)
    by_steps.set(xlabel="control steps [millions]", ylabel="reward of a step", title=options.title)
    by_time.set(xlabel="processor time [s]")
    for axes in (by_steps, by_time):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.tight_layout()
    figure.savefig(options.output, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main()
