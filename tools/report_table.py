#!/usr/bin/env python3
"""Prints one table from the JSON reports of `stiction solve --json`.

Usage: report_table.py NAME=REPORT.json ...        NAME is what the first column shows

Ends with a line for each batch and solver that was solved on more than one device, saying whether the hashes agree.
Exit status 1 if any do not.
"""

import argparse
import collections
import json
import sys

HEADERS = ["batch", "environments", "rows", "solver", "device", "precision", "seconds", "environments/s",
           "iterations median/max", "residual median", "p90", "max", "missed", "hash"]
LEFT = {0, 3, 4, 5, 13}


def quantile(report, key, name, form):
    values = report.get(key)
    return form.format(values[name]) if values and values.get(name) is not None else "-"


def row(name, report):
    seconds = report["seconds"]["solve"]
    rate = f"{report['environments'] / seconds:.0f}" if seconds > 0 else "-"
    iterations = quantile(report, "iterations", "median", "{:g}") + "/" + quantile(report, "iterations", "max", "{:g}")
    return [name, str(report["environments"]), str(report["rows"]), report["solver"], report["device"],
            report["precision"], f"{seconds:.3f}", rate, iterations,
            *(quantile(report, "residual", q, "{:.1e}") for q in ("median", "p90", "max")),
            str(report["unconverged"]), report["hash"]]


def print_table(rows):
    widths = [max(len(r[i]) for r in [HEADERS, *rows]) for i in range(len(HEADERS))]
    def line(cells):
        return "  ".join(c.ljust(w) if i in LEFT else c.rjust(w) for i, (c, w) in enumerate(zip(cells, widths))).rstrip()
    print(line(HEADERS))
    print("  ".join("-" * w for w in widths))
    for index, cells in enumerate(rows):
        if index and cells[0] != rows[index - 1][0]:
            print()
        print(line(cells))


def compare_devices(named):
    """Prints agreement of hashes between devices; returns how many groups disagree."""
    groups = collections.OrderedDict()
    for name, report in named:
        groups.setdefault((name, report["solver"], report["precision"], report["law"]), {})[report["device"]] = report["hash"]
    several = {key: hashes for key, hashes in groups.items() if len(hashes) > 1}
    different = [key for key, hashes in several.items() if len(set(hashes.values())) > 1]
    if several:
        print(f"\n{len(several) - len(different)} of {len(several)} systems have the same hash on "
              f"{', '.join(sorted({d for h in several.values() for d in h}))}")
    for key in different:
        print(f"different: {' '.join(key)}: {several[key]}")
    return len(different)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("reports", nargs="+", metavar="NAME=REPORT.json")
    named = []
    for argument in parser.parse_args().reports:
        name, _, path = argument.partition("=")
        with open(path, encoding="utf-8") as file:
            named.append((name, json.load(file)))
    print_table([row(name, report) for name, report in named])
    return 1 if compare_devices(named) else 0


if __name__ == "__main__":
    sys.exit(main())
