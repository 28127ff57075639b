#!/usr/bin/env python3
"""Runs the clang-tidy that tools/requirements-lint.txt pins over the sources of a build.

Usage: lint_tidy.py BUILD [--jobs N] [--under FOLDER ...] [FILE ...]

Without files: every C++ source that the build compiles under core, c_api, cpu_fallback, cuda, tools, bench and examples.
Headers are checked through the sources that include them.

Exit status 0 clean, 1 findings, 77 that clang-tidy or compile_commands.json is not here (CTest counts it as skipped).
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys

from lint_tools import ROOT, SKIPPED, find, missing

FOLDERS = ("core", "c_api", "cpu_fallback", "cuda", "tools", "bench", "examples")
# The build's compiler may be GCC: its warnings by name are unknown to clang, and are not what is looked for here.
QUIET = ("--extra-arg=-Wno-unknown-warning-option", "--extra-arg=-Wno-everything")


def of_build(build, folders):
    """Sources that the build compiles, below the folders, each once."""
    commands = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))
    found = {pathlib.Path(command["directory"], command["file"]).resolve() for command in commands}
    return sorted(file for file in found if file.suffix == ".cpp" and build.resolve() not in file.parents
                  and file.is_relative_to(ROOT) and file.relative_to(ROOT).parts[0] in folders)


def check(program, build, file):
    """Findings in one source, empty where there are none."""
    run = subprocess.run([program, "-p", str(build), "--quiet", *QUIET, str(file)], capture_output=True, text=True,
                         check=False)
    return "" if run.returncode == 0 else run.stdout or run.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--under", nargs="+", default=FOLDERS, metavar="FOLDER")
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    arguments = parser.parse_args()
    program = find("clang-tidy")
    if program is None:
        print(missing("clang-tidy"))
        return SKIPPED
    if not (arguments.build / "compile_commands.json").is_file():
        print(f"SKIPPED: {arguments.build} has no compile_commands.json; nothing checked")
        return SKIPPED
    files = arguments.files or of_build(arguments.build, arguments.under)
    bad = 0
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        runs = pool.map(lambda file: check(program, arguments.build, file), files)
        for number, (file, findings) in enumerate(zip(files, runs), 1):
            if findings:
                bad += 1
                print(findings, flush=True)
            elif sys.stdout.isatty():
                print(f"\r{number} of {len(files)}", end="", flush=True)
    print(f"{len(files)} files, {bad} with findings")
    return 1 if bad or not files else 0


if __name__ == "__main__":
    sys.exit(main())
