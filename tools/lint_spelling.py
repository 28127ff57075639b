#!/usr/bin/env python3
"""Checks the spelling of pages, comments and messages with the codespell that tools/requirements-lint.txt pins.

Usage: lint_spelling.py [FILE ...]        without files: every text git knows

Exit status 0 clean, 1 a misspelling, 77 that codespell is not on this machine (CTest counts it as skipped).
"""

import subprocess
import sys

from lint_tools import ROOT, SKIPPED, find, missing

SUFFIXES = {".md", ".py", ".hpp", ".cpp", ".cu", ".cuh", ".h", ".c", ".cmake", ".sh", ".txt", ".toml", ".yml"}
KNOWN = "atmost,commun,datas,fro,kinf,numer,reacher,suh"  # identifiers, models, journals and persons


def main():
    program = find("codespell")
    if program is None:
        print(missing("codespell"))
        return SKIPPED
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=False).stdout
    names = [name for name in listed.splitlines() if not name.startswith("bench/results/")]
    files = sys.argv[1:] or [str(ROOT / name) for name in names if (ROOT / name).suffix in SUFFIXES and (ROOT / name).is_file()]
    status = subprocess.run([program, "--ignore-words-list", KNOWN, *files], check=False).returncode
    print(f"{len(files)} files, {'clean' if status == 0 else 'misspelled'}")
    return 1 if status or not files else 0


if __name__ == "__main__":
    sys.exit(main())
