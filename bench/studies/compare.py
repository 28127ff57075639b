#!/usr/bin/env python3
"""Two folders of benchmark results side by side.

    bench/studies/compare.py bench/results/BEFORE bench/results/AFTER [--all]

Prints nanoseconds per contact and sweep of both, their quotient (above 1: the second is faster), and whether the hashes
agree. A stiction result whose hash changed is marked: it computed something else, and its time means nothing until the
numerics epoch explains it. Without --all only rows that changed by more than a tenth are listed, the slowest first.
"""

import argparse
import pathlib
import statistics
import sys

import table

# File: (columns that name a row, column of nanoseconds, column of the hash).
TABLES = {
    "headline.csv": (("family", "precision", "contacts", "envs", "implementation", "flags"), "ns_sweeps", "hash_20"),
    "ratio.csv": (("family", "precision", "contacts", "envs", "implementation", "flags"), "ns_sweeps", "hash_20"),
    "solvers.csv": (("name",), "ns_per_contact_sweep", "hash"),
    "baselines.csv": (("name",), "ns_per_contact_sweep", "hash"),
}


def load(folder, name):
    """{row name: (nanoseconds, hash)}, empty if the folder has no such table."""
    keys, time, digest = TABLES[name]
    path = pathlib.Path(folder) / name
    if not path.exists():
        return {}
    _, rows = table.read(path)
    return {" ".join(row[key] for key in keys): (float(row[time]), row[digest]) for row in rows}


def compare(name, before, after, show_all):
    """Prints one table; returns how many stiction hashes differ."""
    common = [row for row in before if row in after]
    only = len(before) + len(after) - 2 * len(common)
    if not common:
        print(f"{name}: no row in common")
        return 0
    quotients = {row: before[row][0] / after[row][0] for row in common if after[row][0] > 0}
    changed = [row for row in common if before[row][1] != after[row][1]]
    print(f"{name}: {len(common)} rows in common, {only} in one folder only; "
          f"before/after median {statistics.median(quotients.values()):.2f}, "
          f"{min(quotients.values()):.2f} to {max(quotients.values()):.2f}")
    for row, quotient in sorted(quotients.items(), key=lambda item: item[1]):
        if show_all or abs(quotient - 1) > 0.1 or row in changed:
            mark = "  HASH CHANGED" if row in changed else ""
            print(f"  {before[row][0]:10.2f} {after[row][0]:10.2f} {quotient:6.2f}  {row}{mark}")
    return sum("stiction" in row for row in changed)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("--all", action="store_true", help="rows that hardly changed as well")
    arguments = parser.parse_args()
    for folder in (arguments.before, arguments.after):
        if not any((pathlib.Path(folder) / name).exists() for name in TABLES):
            sys.exit(f"compare.py: '{folder}' holds none of {', '.join(TABLES)}")
    changed = sum(
        compare(name, load(arguments.before, name), load(arguments.after, name), arguments.all) for name in TABLES)
    if changed:
        sys.exit(f"compare.py: {changed} stiction results have other bits than before")


if __name__ == "__main__":
    main()
