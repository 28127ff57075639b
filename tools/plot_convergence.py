#!/usr/bin/env python3
"""Draw residual against iterations from the convergence files of several solvers.

    stiction solve batch.h5 --solver npgs --convergence npgs.csv
    stiction solve batch.h5 --solver apgd --convergence apgd.csv
    plot_convergence.py npgs=npgs.csv apgd=apgd.csv -o residual.png --tolerance 1e-6

A convergence file (a trace, below) is a CSV file with the header iteration,median,p90,max. It has quantiles over the
environments of the relative residual after that many iterations. Lines that begin with # are skipped. Each
solver gets one colour: the median as a line, the 90th percentile dashed, the worst environment dotted, the space
between median and worst tinted. Iteration 0 (the start) and residuals of exactly zero have no place on logarithmic
axes and are left out. Exit status: 0 drawn, 2 bad input, with one sentence. Needs numpy and matplotlib.
"""
import argparse
import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")  # no display is needed to write a file
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

COLUMNS = ("iteration", "median", "p90", "max")
# Okabe and Ito's colours, distinct for people with any colour vision; the darkest first.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


class TraceError(Exception):
    """A trace file has other contents than it claims; the message is one sentence for the user."""


def read_trace(path):
    """The four columns as float arrays keyed by name. \\throws TraceError."""
    try:
        lines = [line for line in Path(path).read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise TraceError(f"{path}: cannot be read as text: {error}") from error
    reader = csv.DictReader(lines)
    missing = [name for name in COLUMNS if name not in (reader.fieldnames or ())]
    if missing:
        raise TraceError(f"{path}: not a trace: the header lacks {', '.join(missing)}")
    try:
        rows = [[float(row[name]) for name in COLUMNS] for row in reader]
    except (TypeError, ValueError) as error:
        raise TraceError(f"{path}: a value is not a number: {error}") from error
    values = np.array(rows).reshape(-1, len(COLUMNS))
    values = values[values[:, 0] >= 1]
    if not len(values):
        raise TraceError(f"{path}: the trace has no iteration from 1 on")
    residuals = values[:, 1:]
    residuals[~(np.isfinite(residuals) & (residuals > 0))] = np.nan
    return dict(zip(COLUMNS, values.T))


def named(argument):
    """NAME=FILE, or a file that is called by its stem."""
    name, separator, path = argument.partition("=")
    return (name, path) if separator else (Path(argument).stem, argument)


def draw(traces, path, title=None, tolerance=None):
    """Writes the picture of {name: trace} to `path`; the suffix chooses the format."""
    figure, axes = plt.subplots(figsize=(8, 5), dpi=150, layout="constrained")
    for index, (name, trace) in enumerate(traces.items()):
        color, x = COLORS[index % len(COLORS)], trace["iteration"]
        axes.fill_between(x, trace["median"], trace["max"], color=color, alpha=0.10, linewidth=0)
        axes.plot(x, trace["median"], color=color, linewidth=2, label=name)
        axes.plot(x, trace["p90"], color=color, linewidth=1, linestyle="--")
        axes.plot(x, trace["max"], color=color, linewidth=1, linestyle=":")
    if tolerance is not None:
        axes.axhline(tolerance, color="#666666", linewidth=0.8)
        axes.annotate(f"tolerance {tolerance:g}", (0, tolerance), xycoords=("axes fraction", "data"), xytext=(4, 3),
                      textcoords="offset points", color="#666666", fontsize="small")
    for text, style in (("median (coloured: the solver)", "-"), ("90th percentile", "--"), ("worst environment", ":")):
        axes.plot([], [], color="#444444", linestyle=style, label=text)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("iteration")
    axes.set_ylabel("relative residual [-]")
    axes.legend(frameon=False, fontsize="small", loc="lower left")
    if title:
        axes.set_title(title, loc="left", fontsize="medium")
    # Without this the picture carries the version of matplotlib, and the same traces give different files.
    figure.savefig(path, metadata={"Software": None} if Path(path).suffix == ".png" else None)
    plt.close(figure)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("traces", nargs="+", metavar="[NAME=]TRACE.csv",
                        help="traces written by stiction solve --convergence")
    parser.add_argument("-o", "--output", required=True, metavar="PICTURE.png")
    parser.add_argument("--title")
    parser.add_argument("--tolerance", type=float, help="draw a line at this residual")
    options = parser.parse_args(arguments)
    pairs = [named(argument) for argument in options.traces]
    try:
        repeated = sorted({name for name, _ in pairs if [n for n, _ in pairs].count(name) > 1})
        if repeated:
            raise TraceError(f"two traces are called {repeated[0]}; name them apart with NAME=FILE")
        draw({name: read_trace(path) for name, path in pairs}, options.output, options.title, options.tolerance)
    except (TraceError, OSError, ValueError) as error:
        print(f"plot_convergence: {error}", file=sys.stderr)
        return 2
    print(f"{options.output}: {', '.join(name for name, _ in pairs)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
