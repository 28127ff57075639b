#!/usr/bin/env python3
"""Nanoseconds per contact and sweep against contacts of an environment, from a results' folder.

    bench/studies/plot.py bench/results/MACHINE [-o docs/images/bench_contacts.png]
"""

import argparse
import pathlib

import matplotlib
import matplotlib.ticker

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  the backend has to be chosen first
import table  # noqa: E402

# (implementation, flags or None for any, precision, label, colour, line)
CURVES = [
    ("naive", "-O3", "f32", "naive loop, f32", "tab:red", "-"),
    ("naive_csr", "-O3", "f32", "naive loop on CSR, f32", "tab:orange", "-"),
    ("eigen", "-O3 -march=native", "f32", "Eigen, f32, -march=native", "tab:purple", "-"),
    ("stiction pgs", None, "f32", "stiction pgs, f32", "tab:blue", "-"),
    ("stiction npgs", None, "f32", "stiction npgs, f32", "tab:cyan", "-"),
    ("stiction pgs", None, "f64", "stiction pgs, f64", "tab:blue", "--"),
    ("stiction npgs", None, "f64", "stiction npgs, f64", "tab:cyan", "--"),
]
TITLES = {"stack": "stack (larger systems are sparse)", "face": "contacts of one body (A is full)"}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results")
    parser.add_argument("-o", "--output", default="docs/images/bench_contacts.png")
    arguments = parser.parse_args()
    comments, rows = table.read(pathlib.Path(arguments.results) / "ratio.csv")
    families = list(dict.fromkeys(row["family"] for row in rows))
    figure, axes = plt.subplots(1, len(families), figsize=(6 * len(families), 5), sharey=True, squeeze=False)
    for axis, family in zip(axes[0], families):
        for implementation, flags, precision, label, colour, line in CURVES:
            chosen = [
                row for row in rows if row["family"] == family and row["implementation"] == implementation and
                row["precision"] == precision and flags in (None, row["flags"])
            ]
            if chosen:
                axis.plot([int(row["contacts"]) for row in chosen], [float(row["ns_sweeps"]) for row in chosen],
                          line, color=colour, marker="o", markersize=3, label=label)
        axis.set(title=TITLES.get(family, family), xlabel="contacts of an environment", xscale="log", yscale="log")
        axis.set_xticks(sorted({int(row["contacts"]) for row in rows}))
        axis.get_xaxis().set_major_formatter(matplotlib.ticker.ScalarFormatter())
        axis.minorticks_off()
        axis.grid(True, which="major", alpha=0.3)
    axes[0][0].set_ylabel("ns per contact and sweep, one thread")
    axes[0][0].legend(fontsize=8)
    machine = dict(comment.split(": ", 1) for comment in comments if ": " in comment)
    figure.text(0.01, 0.01, f"{machine.get('processor')}, {machine.get('compiler')}, {machine.get('commit')}", fontsize=7)
    figure.tight_layout(rect=(0, 0.02, 1, 1))
    output = pathlib.Path(arguments.output)
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=120)


if __name__ == "__main__":
    main()
