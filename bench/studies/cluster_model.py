#!/usr/bin/env python3
"""What a cluster would make of the counts of bench_consensus: sequential impulses over ranks against consensus.

Usage: cluster_model.py COUNTS.csv... [--tolerance 1e-3] [--bodies 1e7] [--visit 1e-7]

Fits sweeps = a bodies^q for each method and scene (least squares of logarithms), and for consensus bodies^q subdomains^s.
One sweep of a method is then priced as

    visit * contacts / ranks  +  exchanges (latency + 2 bytes / bandwidth)  +  gathers * latency * log2(ranks)

exchanges and gathers: per sweep, as counted. bytes: of one rank in one exchange, as counted and scaled. The scale is (bodies
per rank / counted bodies per rank)^((d - 1) / d), d = 2 for a wall and 3 for a pile. The factor 2 is for ranks with
neighbours on all sides. visit: seconds of one contact in one sweep, a guess. Ranks are assumed to be equally loaded.
Latencies of a rank's neighbours overlap, and nothing overlaps with sweeps. Consensus has as many subdomains as ranks. Laws
that were fitted to small scenes are assumed to hold at that size.
"""

import argparse
import csv
import math

import numpy

DIMENSION = {"wall": 2, "pile": 3}  # a tower of millions would mean nothing
CLUSTERS = [("fast, 2 us, 10 GB/s", 2e-6, 1e10), ("Ethernet, 30 us, 1 GB/s", 3e-5, 1e9), ("cloud, 500 us, 0.1 GB/s", 5e-4, 1e8)]
RANKS = [64, 1024, 16384]


def read(paths):
    rows = []
    for path in paths:
        with open(path, encoding="utf-8") as file:
            rows += list(csv.DictReader(line for line in file if not line.startswith("#")))
    return rows


def fit(rows, with_subdomains):
    """Coefficients of log sweeps over 1, log bodies and, if those differ, log subdomains; what does not vary gets 0."""
    columns = [[1.0] * len(rows), [math.log(int(row["bodies"])) for row in rows]]
    if with_subdomains:
        columns.append([math.log(int(row["subdomains"])) for row in rows])
    used = [k for k, column in enumerate(columns) if k == 0 or max(column) > min(column)]
    matrix = numpy.array([columns[k] for k in used]).T
    found = numpy.linalg.lstsq(matrix, numpy.log([int(row["sweeps"]) for row in rows]), rcond=None)[0]
    full = [0.0] * len(columns)
    for k, value in zip(used, found):
        full[k] = float(value)
    return full


def sweeps_at(coefficients, bodies, subdomains):
    logarithms = [1.0, math.log(bodies), math.log(subdomains)]
    return math.exp(sum(c * x for c, x in zip(coefficients, logarithms)))


def price(row, bodies, ranks, latency, bandwidth, visit):
    """Seconds of one sweep."""
    dimension = DIMENSION[row["scene"]]
    sweeps, counted = int(row["sweeps"]), int(row["bodies"]) / int(row["ranks"])
    sent = int(row["bytes"]) / int(row["ranks"]) / max(int(row["exchanges"]), 1)
    sent *= (bodies / ranks / counted) ** ((dimension - 1) / dimension)
    contacts = int(row["contacts"]) / int(row["bodies"]) * bodies
    exchange = latency + 2 * sent / bandwidth
    return (visit * contacts / ranks + int(row["exchanges"]) / sweeps * exchange
            + int(row["gathers"]) / sweeps * latency * math.log2(ranks))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("counts", nargs="+")
    parser.add_argument("--tolerance", type=float, default=1e-3)
    parser.add_argument("--bodies", type=float, default=1e7)
    parser.add_argument("--visit", type=float, default=1e-7)
    given = parser.parse_args()
    rows = [row for row in read(given.counts)
            if float(row["tolerance"]) == given.tolerance and row["code"] == "solved" and int(row["sweeps"]) > 0]
    print(f"{given.bodies:g} bodies to {given.tolerance:g}, {1e9 * given.visit:g} ns a visit. Seconds of one solve; latency")
    print("from which on consensus is faster, at 1 GB/s.\n")
    print("| scene | ranks | cluster | si | consensus | ratio | even from |\n|---|---|---|---|---|---|---|")
    laws = {}
    for scene in sorted({row["scene"] for row in rows} & set(DIMENSION)):
        by = {method: [row for row in rows if row["scene"] == scene and row["method"] == method]
              for method in ("si", "consensus")}
        if not by["si"] or not by["consensus"]:
            continue
        laws[scene] = {method: fit(by[method], method == "consensus") for method in by}

        def seconds(method, ranks, latency, bandwidth):
            largest = max(by[method], key=lambda row: int(row["bodies"]))
            return (sweeps_at(laws[scene][method], given.bodies, ranks)
                    * price(largest, given.bodies, ranks, latency, bandwidth, given.visit))

        for ranks in RANKS:
            # Both are lines over latency.
            at_zero, slope = ([seconds("consensus", ranks, x, 1e9) - seconds("si", ranks, x, 1e9) for x in (0, 1)])
            even = at_zero / (at_zero - slope) if slope < at_zero else math.inf
            for name, latency, bandwidth in CLUSTERS:
                si, consensus = (seconds(method, ranks, latency, bandwidth) for method in ("si", "consensus"))
                print(f"| {scene} | {ranks} | {name} | {si:.2g} | {consensus:.2g} | {consensus / si:.2g} | {1e6 * even:.2g} us |")
    for scene, law in laws.items():
        print(f"\n{scene}: si sweeps = {math.exp(law['si'][0]):.3g} bodies^{law['si'][1]:.2f}; consensus sweeps = "
              f"{math.exp(law['consensus'][0]):.3g} bodies^{law['consensus'][1]:.2f} subdomains^{law['consensus'][2]:.2f}")


if __name__ == "__main__":
    main()
