#!/usr/bin/env python3
"""Checks the formatting of C++ and CUDA sources with clang-format 14, the version whose output the tree follows.

Usage: lint_format.py [--fix] [FILE ...]        without files: every source git knows

Exit status 0 clean, 1 badly formatted, 77 no clang-format 14 on this machine (CTest counts that as skipped).
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".c"}
VERSION = "14"  # other versions break lines differently, and a check that depends on the machine is none
SKIPPED = 77


def find_clang_format():
    for name in (f"clang-format-{VERSION}", "clang-format"):
        program = shutil.which(name)
        if program:
            text = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
            if re.search(rf"version {VERSION}\.", text):
                return program
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fix", action="store_true", help="rewrite the files instead of reporting")
    parser.add_argument("files", nargs="*")
    arguments = parser.parse_args()
    program = find_clang_format()
    if program is None:
        print(f"SKIPPED: clang-format {VERSION} is not here (Debian: clang-format-{VERSION}); formatting not checked")
        return SKIPPED
    files = arguments.files
    if not files:
        listing = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=False)
        names = listing.stdout.splitlines() if listing.returncode == 0 and listing.stdout else [
            f.relative_to(ROOT).as_posix() for f in ROOT.rglob("*") if not f.relative_to(ROOT).parts[0].startswith("build")]
        files = [str(ROOT / name) for name in names
                 if pathlib.PurePosixPath(name).suffix in SUFFIXES and (ROOT / name).is_file()]
    if not files:
        print("no sources found")
        return 1
    mode = ["-i"] if arguments.fix else ["--dry-run", "-Werror"]
    status = subprocess.run([program, *mode, "--style=file", *files], check=False).returncode
    print(f"{len(files)} files, {'rewritten' if arguments.fix else 'clean' if status == 0 else 'badly formatted'}")
    return 1 if status else 0


if __name__ == "__main__":
    sys.exit(main())
