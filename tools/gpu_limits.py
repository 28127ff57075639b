#!/usr/bin/env python3
"""Which size class is fastest for environments of a number of rows, from what gpu_first measured.

    gpu_limits.py RESULTS.jsonl LIMITS.csv

A line of the table: rows and number of environments, the class that their rows give them, the fastest class, and the
time of each. The library does not read the table: its limits are those of ClassRules (cuda/machine/engine.hpp). They
are changed by hand, where the table says so at every number of environments.
"""

import csv
import json
import pathlib
import sys

# The order of SizeClass.
CLASSES = ["sparse_device", "sparse_block", "factor_warp", "dense_large", "dense_block", "dense_warp", "dense_tile",
           "thread_large", "thread_medium", "thread_small", "trivial"]


def read(path):
    """{(rows, envs): (own class, {class: ns an environment})} of the lines that tuning wrote."""
    points = {}
    for line in path.read_text().splitlines():
        try:
            result = json.loads(line)
        except ValueError:
            continue
        if result.get("result") != "measured" or not result.get("check", "").startswith("tune/") or "class" not in result:
            continue
        own, times = points.setdefault((result["rows"], result["envs"]), (result["own_class"], {}))
        times[result["class"]] = result["ns_per_env"]
    return points


def table(points):
    rows = []
    for (count, envs), (own, times) in sorted(points.items(), key=lambda item: (item[0][1], item[0][0])):
        best = min(times, key=times.get)
        gain = times[own] / times[best] if own in times and times[best] > 0 else float("nan")
        rows.append({"envs": envs, "rows": count, "own": CLASSES[own], "best": CLASSES[best], "own_over_best": f"{gain:.3g}",
                     **{CLASSES[k]: f"{times[k]:.4g}" for k in times}})
    return rows


def main():
    if len(sys.argv) != 3:
        print("gpu_limits.py: give results and a table to write", file=sys.stderr)
        return 2
    rows = table(read(pathlib.Path(sys.argv[1])))
    if not rows:
        print(f"gpu_limits.py: {sys.argv[1]} has no line of tuning", file=sys.stderr)
        return 1
    columns = ["envs", "rows", "own", "best", "own_over_best", *CLASSES[3:10]]
    with open(sys.argv[2], "w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)
    other = [row for row in rows if row["own"] != row["best"]]
    print(f"{sys.argv[2]}: {len(rows)} sizes, another class is faster for {len(other)}; the limits are those of "
          "ClassRules in cuda/machine/engine.hpp, which no program reads from this table")
    return 0


if __name__ == "__main__":
    sys.exit(main())
