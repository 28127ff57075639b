#!/usr/bin/env python3
"""Checks the prose of pages, comments and messages with the proselint that tools/requirements-lint.txt pins.

Usage: lint_prose.py [FILE ...]        without files: every text git knows

Code, formulas and headings are left out (sentences.py). Exit status 0 clean, 1 a finding, 77 that proselint is not on
this machine (CTest counts it as skipped).
"""

import collections
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import sentences
from lint_tools import ROOT, SKIPPED, find, missing
from lint_words import tracked_files

# Checks that are off. Symbols are ASCII. Matrices, tables and p = 0 are not prose, spelling is codespell's, and the
# last four take multiply-add, revolute joints and sans-serif for mistakes.
OFF = ["typography", "lexical_illusions", "psychology", "spelling", "misc.phrasal_adjectives.ly",
       "needless_variants", "misc.preferred_forms", "misc.illogic"]
SUFFIXES = sentences.C_SUFFIXES | {".md", ".py"}
FINDING = re.compile(r"texts/(.+)\.txt:(\d+):\d+: (.+)")


def prose_of(path, text):
    """Units and messages of a file, each on the line of its beginning, without code."""
    lines = collections.defaultdict(list)
    for number, unit in sentences.units_of(path, text) + sentences.messages(path, text):
        lines[number].append(" ".join(sentences.sentences(unit)))
    return "".join(" | ".join(lines[number]) + "\n" for number in range(1, max(lines, default=0) + 1))


def main():
    program = find("proselint", "version")
    if program is None:
        print(missing("proselint"))
        return SKIPPED
    names = sys.argv[1:] or [name for name in tracked_files(ROOT) if not name.startswith("bench/results/")]
    names = [name for name in names if pathlib.PurePosixPath(name).suffix in SUFFIXES and (ROOT / name).is_file()]
    with tempfile.TemporaryDirectory() as folder:
        config = pathlib.Path(folder, "config.json")
        config.write_text(json.dumps({"max_errors": 100000, "checks": dict.fromkeys(OFF, False)}), encoding="utf-8")
        for name in names:
            target = pathlib.Path(folder, "texts", f"{name}.txt")
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(prose_of(name, (ROOT / name).read_text(encoding="utf-8")), encoding="utf-8")
        listing = subprocess.run([program, "check", "--config", str(config), "--output-format", "full", f"{folder}/texts"],
                                 capture_output=True, text=True, check=False)
    found = FINDING.findall(re.sub(r"\x1b\[[0-9;]*m", "", listing.stdout))
    for name, line, finding in found:
        print(f"{name}:{line}: {finding}")
    if listing.returncode and not found:
        print(listing.stdout + listing.stderr)
    print(f"{len(names)} files, {len(found)} findings")
    return 1 if listing.returncode or not names else 0


if __name__ == "__main__":
    sys.exit(main())
