#!/usr/bin/env python3
"""Write tests/support/golden/hashes.inc from a build's hashes, and list the changes.

usage: tools/update_goldens.py BUILD_DIR [--reason "one sentence"]
       tools/update_goldens.py --self-test

Builds and runs determinism_test_golden of BUILD_DIR; the next build of the test reads the new table. New rows are
added as they are. A row that changed or vanished is refused unless kNumericsEpoch (core/include/stiction/config.hpp)
is higher than the epoch in the table's first line. Raise it, say why in CHANGELOG.md, and give the reason here, which
goes into that line. Further changes within an epoch that was never released start from the table of the epoch before
(git checkout of the table). Exit status: 0 done (also when nothing changed), 1 refused, 2 usage, or a build or table
that is broken.
"""
import argparse
import contextlib
import io
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "tests" / "support" / "golden" / "hashes.inc"
CONFIG = ROOT / "core" / "include" / "stiction" / "config.hpp"
TARGET = "determinism_test_golden"
HEADER = re.compile(r"// Numerics epoch (\d+)\. .*")
ROW = re.compile(r' *\{"([^"]+)", (0x[0-9a-f]{16})ULL\},')
EPOCH = re.compile(r"kNumericsEpoch = (\d+);")


class Broken(Exception):
    """A table that cannot be read; the text gives the reason."""


def rows(lines):
    """The table as a dictionary from a row's name to its hash."""
    table = {}
    for line in lines:
        match = ROW.fullmatch(line)
        if not match:
            raise Broken(f"no row of a table: {line}")
        name, value = match.groups()
        if name in table:
            raise Broken(f"two rows have the name {name}")
        table[name] = value
    return table


def update(table, config, printed, reason):
    """Writes the table that a build printed unless that is refused. Returns the exit status."""
    try:
        new = rows(printed.splitlines())
        header, *lines = table.read_text().splitlines() or [""]
        old = rows(lines)
    except Broken as broken:
        print(broken, file=sys.stderr)
        return 2
    first = HEADER.fullmatch(header)
    found = EPOCH.search(config.read_text())
    if not first or not found or not new:
        print(f"no epoch in the first line of {table}, none in {config}, or no row printed", file=sys.stderr)
        return 2
    then, now = int(first.group(1)), int(found.group(1))
    added = [name for name in new if name not in old]
    changed = [name for name in new if name in old and old[name] != new[name]]
    gone = [name for name in old if name not in new]
    touched = changed + gone
    if now < then:
        print(f"kNumericsEpoch is {now} and the table is of epoch {then}: epochs do not fall", file=sys.stderr)
        return 1
    if touched and now == then:
        print(f"refused: {len(changed)} rows changed and {len(gone)} vanished (the first is {touched[0]}) within epoch "
              f"{then}; raise kNumericsEpoch in {config.name} and say why in CHANGELOG.md", file=sys.stderr)
        return 1
    if now > then:
        if not reason:
            print(f"epoch {now} is new: --reason says why the bits changed", file=sys.stderr)
            return 2
        header = f"// Numerics epoch {now}. Last change: {reason} (tools/update_goldens.py)"
    text = "\n".join([header, *printed.splitlines()]) + "\n"
    if text == table.read_text():
        print(f"{len(new)} rows, none changed; {table.name} is left alone")
        return 0
    table.write_text(text)
    for word, names in (("changed", changed), ("new", added), ("gone", gone)):
        for name in names:
            print(f"{word:8} {name}")
    print(f"{len(new)} rows, {len(changed)} changed, {len(added)} new, {len(gone)} gone; epoch {now}")
    return 0


def self_test():
    """Every way to change a table, and whether it is let through."""
    old = {"matrix/a/pgs/f32/convex": 1, "matrix/b/pgs/f32/convex": 2}
    changed = {**old, "matrix/b/pgs/f32/convex": 3}
    added = {**old, "worlds/c/si/f64/coulomb": 4}
    fewer = {"matrix/a/pgs/f32/convex": 1}
    renamed = {"matrix/a/pgs/f32/convex": 1, "matrix/z/pgs/f32/convex": 2}
    swapped = {"matrix/a/pgs/f32/convex": 2, "matrix/b/pgs/f32/convex": 1}
    turned = dict(reversed(old.items()))

    def text(table):
        return "".join(f'    {{"{name}", 0x{value:016x}ULL}},\n' for name, value in table.items())

    twice = text(old) + text(fewer)
    # a build's output, epoch now, reason, exit status, whether the table is written anew
    cases = [(text(old), 2, None, 0, False), (text(added), 2, None, 0, True), (text(turned), 2, None, 0, True),
             (text(changed), 2, "why", 1, False), (text(fewer), 2, "why", 1, False), (text(renamed), 2, "why", 1, False),
             (text(swapped), 2, "why", 1, False), (text(changed), 3, "why", 0, True), (text(fewer), 3, "why", 0, True),
             (text(changed), 3, None, 2, False), (text(old), 3, "why", 0, True), (text(changed), 1, "why", 1, False),
             ("", 2, "why", 2, False), (twice, 2, "why", 2, False), ("Killed\n", 2, "why", 2, False)]
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        table, config = pathlib.Path(folder) / "golden.inc", pathlib.Path(folder) / "config.hpp"
        header = "// Numerics epoch 2. Last change: before\n"

        def expect(what, printed, epoch, reason, status, is_written, begin=header + text(old)):
            nonlocal failures
            table.write_text(begin)
            config.write_text(f"inline constexpr int kNumericsEpoch = {epoch};\n")
            said = io.StringIO()
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                got = update(table, config, printed, reason)
            after = table.read_text()
            right = got == status and (after != begin) == is_written
            if is_written:
                right &= after.startswith(f"// Numerics epoch {epoch}. ") and after.endswith(printed)
                right &= ("Last change: before" in after) == (epoch == 2)
            if not right:
                print(f"{what}: exit status {got}, expected {status}; {said.getvalue()}the table is now\n{after}", file=sys.stderr)
                failures += 1

        for number, case in enumerate(cases):
            expect(f"case {number}", *case)
        expect("a table without an epoch", text(added), 2, "why", 2, False, begin=text(old))
        expect("a table with a line that is no row", text(added), 2, "why", 2, False, begin=header + "{1, 2},\n")
    print("self-test failed" if failures else f"self-test passed: {len(cases) + 2} cases")
    return 1 if failures else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build_dir", type=pathlib.Path, nargs="?")
    parser.add_argument("--reason", help="why the bits changed, one sentence; a new epoch needs it")
    parser.add_argument("--self-test", action="store_true", help="try the rules on tables of this script's own")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if arguments.build_dir is None:
        parser.error("BUILD_DIR is missing")
    reason = (arguments.reason or "").strip()
    if "\n" in reason:
        parser.error("--reason: give one sentence on one line")

    build = subprocess.run(["cmake", "--build", arguments.build_dir, "--target", TARGET], stdout=subprocess.DEVNULL)
    if build.returncode != 0:
        print(f"{TARGET} does not build in {arguments.build_dir}", file=sys.stderr)
        return 2
    printed = subprocess.run([arguments.build_dir / "tests" / TARGET, "--print-goldens"], capture_output=True, text=True)
    if printed.returncode != 0:
        print(f"{TARGET} --print-goldens failed: {printed.stderr.strip()}", file=sys.stderr)
        return 2
    return update(TABLE, CONFIG, printed.stdout, reason)


if __name__ == "__main__":
    sys.exit(main())
