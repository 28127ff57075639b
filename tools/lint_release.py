#!/usr/bin/env python3
"""Checks that version, date and numerics epoch of the latest release are the same in every file that states them.

Usage: lint_release.py [--root DIR] [--self-test]
"""

import datetime
import pathlib
import re
import sys
import tempfile

import lint_tools

CHANGELOG = "CHANGELOG.md"
SECTION = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d{2}-\d{2}) - numerics epoch (\d+)$", re.M)
CONFIG = "core/include/stiction/config.hpp"
# (file, text before the version or the date)
VERSIONS = [("CMakeLists.txt", "project(stiction VERSION "), (CONFIG, 'kVersion = "'), ("CITATION.cff", "\nversion: "),
            ("packaging/conda/recipe.yaml", 'version: "'), ("tests/c_api/test_errors.c", 'strcmp(stiction_version(), "')]
DATES = [("CITATION.cff", "date-released: ", "%Y-%m-%d"), ("packaging/debian/changelog.in", "@  ", "%a, %d %b %Y")]


def check_tree(root):
    """Number of files, and a sentence for each that differs from the changelog's newest section with a number."""
    texts = {path: (root / path).read_text(encoding="utf-8")
             for path in [CHANGELOG, *(file for file, *_ in VERSIONS + DATES)]}
    newest = SECTION.search(texts[CHANGELOG])
    if newest is None:
        return len(texts), [f"{CHANGELOG}: no section '## [X.Y.Z] - YYYY-MM-DD - numerics epoch N'"]
    version, day, epoch = newest.groups()
    wanted = [(file, before + version) for file, before in VERSIONS]
    wanted += [(file, before + datetime.date.fromisoformat(day).strftime(form)) for file, before, form in DATES]
    wanted += [(CONFIG, f"STICTION_VERSION_{name} {number}\\b")
               for name, number in zip(("MAJOR", "MINOR", "PATCH"), version.split("."))]
    wanted.append((CONFIG, f"kNumericsEpoch = {epoch};"))
    found = [f"{file}: expected '{text.strip()}', as {CHANGELOG} has it" for file, text in wanted
             if not re.search(text if text.endswith(r"\b") else re.escape(text) + r"(?![\d.]*\d)", texts[file])]
    if not texts[CHANGELOG].split("\n## ", 2)[1].startswith("[Unreleased]"):
        found.append(f"{CHANGELOG}: the first section is [Unreleased]")
    return len(texts), found


def self_test():
    """A clean tree, and one with each mistake."""
    config = "\n#define STICTION_VERSION_{0}\nkVersion = \"1.2.3\";\nkNumericsEpoch = 4;\n".format(
        "MAJOR 1\n#define STICTION_VERSION_MINOR 2\n#define STICTION_VERSION_PATCH 3")
    head = "# Changelog\n\n## [Unreleased]\n"
    clean = {CHANGELOG: head, CONFIG: config, "CMakeLists.txt": "project(stiction VERSION 1.2.3 LANGUAGES C\n",
             "CITATION.cff": "a: b\nversion: 1.2.3\ndate-released: 2026-11-30\n",
             "packaging/conda/recipe.yaml": 'version: "1.2.3"\n', "packaging/debian/changelog.in": " -- @b@  Mon, 30 Nov 2026\n",
             "tests/c_api/test_errors.c": 'strcmp(stiction_version(), "1.2.3")\n'}
    day = "\n## [1.2.3] - 2026-11-30 - numerics epoch 4\n"
    cases = [(day, 0), ("", 1), (day.replace("epoch 4", "epoch 5"), 1), (day.replace("-30", "-29"), 2),
             (day.replace("1.2.3", "1.2.33"), 6), (day.replace("1.2.3", "1.2.4"), 6), (day.replace("1.2.3", "1.2"), 1)]
    failed = 0
    for section, expected in cases:
        with tempfile.TemporaryDirectory() as folder:
            for path, text in (clean | {CHANGELOG: head + section}).items():
                (pathlib.Path(folder) / path).parent.mkdir(parents=True, exist_ok=True)
                (pathlib.Path(folder) / path).write_text(text, encoding="utf-8")
            problems = check_tree(pathlib.Path(folder))[1]
        if len(problems) != expected:
            failed += 1
            print(f"{section.strip()!r}: expected {expected}, got {problems}")
    print(f"self-test: {len(cases)} cases, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
