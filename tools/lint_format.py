#!/usr/bin/env python3
"""Checks the formatting of C++ and CUDA sources with the clang-format that tools/requirements-lint.txt pins.

Usage: lint_format.py [--fix] [FILE ...]        without files: every source git knows

Exit status 0 clean, 1 badly formatted, 77 that clang-format is not on this machine (CTest counts it as skipped).
"""

import argparse
import subprocess
import sys

from lint_tools import SKIPPED, find, missing, sources


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fix", action="store_true", help="rewrite the files instead of reporting")
    parser.add_argument("files", nargs="*")
    arguments = parser.parse_args()
    program = find("clang-format")
    if program is None:
        print(missing("clang-format"))
        return SKIPPED
    files = arguments.files or [str(file) for file in sources()]
    if not files:
        print("no sources found")
        return 1
    mode = ["-i"] if arguments.fix else ["--dry-run", "-Werror"]
    status = subprocess.run([program, *mode, "--style=file", *files], check=False).returncode
    print(f"{len(files)} files, {'rewritten' if arguments.fix else 'clean' if status == 0 else 'badly formatted'}")
    return 1 if status else 0


if __name__ == "__main__":
    sys.exit(main())
