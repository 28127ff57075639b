#!/usr/bin/env python3
"""Write tests/support/golden.inc from what a build computes, and say what changed.

usage: tools/update_goldens.py BUILD_DIR --reason "one sentence"

Builds and runs determinism_test_golden of BUILD_DIR. The reason goes into the first line of the table, beside the
numerics epoch. Once an epoch has been released, changed rows need a new epoch: raise kNumericsEpoch in
core/include/stiction/config.hpp and say why in CHANGELOG.md. The next build of the test reads the new table.
Exit status: 0 done (also when nothing changed), 2 usage, or a build that fails.
"""
import argparse
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "tests" / "support" / "golden.inc"
CONFIG = ROOT / "core" / "include" / "stiction" / "config.hpp"
TARGET = "determinism_test_golden"
ROW = re.compile(r"\{(.*), (0x[0-9a-f]{16})ULL\}")


def rows(text):
    """The table as a dictionary from its key to its hash."""
    return dict(match.groups() for match in map(ROW.search, text.splitlines()) if match)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build_dir", type=pathlib.Path)
    parser.add_argument("--reason", required=True, help="why the bits changed, one sentence")
    arguments = parser.parse_args()
    if not arguments.reason.strip() or "\n" in arguments.reason:
        parser.error("--reason: give one sentence on one line")

    build = subprocess.run(["cmake", "--build", arguments.build_dir, "--target", TARGET], stdout=subprocess.DEVNULL)
    if build.returncode != 0:
        print(f"{TARGET} does not build in {arguments.build_dir}", file=sys.stderr)
        return 2
    printed = subprocess.run([arguments.build_dir / "tests" / TARGET, "--print-goldens"], capture_output=True, text=True)
    new = rows(printed.stdout)
    if printed.returncode != 0 or not new:
        print(f"{TARGET} --print-goldens printed no table: {printed.stderr.strip()}", file=sys.stderr)
        return 2

    old = rows(TABLE.read_text()) if TABLE.exists() else {}
    changed = [key for key in new if old.get(key) != new[key]]
    gone = [key for key in old if key not in new]
    if not changed and not gone:
        print(f"{len(new)} rows, none changed; {TABLE.name} is left alone")
        return 0
    epoch = re.search(r"kNumericsEpoch = (\d+);", CONFIG.read_text()).group(1)
    header = f"// Numerics epoch {epoch}. Last change: {arguments.reason.strip()} (tools/update_goldens.py)\n"
    TABLE.write_text(header + printed.stdout)
    for key in changed:
        print(f"{'changed' if key in old else 'new':8} {key}")
    print(f"{len(new)} rows, {len(changed)} changed or new, {len(gone)} gone; epoch {epoch}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
