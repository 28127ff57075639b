#!/usr/bin/env python3
"""Runs the clang-tidy that tools/requirements-lint.txt pins over the sources of a build.

Usage: lint_tidy.py BUILD [--under FOLDER ...] [--jobs N] [FILE ...]
       lint_tidy.py --self-test

Without files: every C++ source that the build compiles under the folders; those that CMake writes are left out. With
files, as pre-commit names them: those of them that the build compiles. Headers are checked through the sources that
include them. Sources of a folder are read several at once, and so are their headers. A source that is compiled for
several processors is checked once. Only the part of a command that clang needs to read the source is kept, so the
build's compiler may be GCC.

Exit status 0 clean, 1 findings, 77 that clang-tidy or compile_commands.json is not here (CTest counts it as skipped).
If files are named, a missing one is no failure.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

from lint_tools import ROOT, SKIPPED, find, missing

FOLDERS = ("core", "c_api", "cpu_fallback", "cuda", "distributed", "python", "cli", "scenes", "tools", "bench", "examples")
TAKES_A_WORD = ("-I", "-isystem", "-D", "-U", "-include", "-x")
BUNDLE = 8  # sources that are read at once, at most
DEFINED = re.compile(r"^(?!using |namespace |template |#|//)\w[^=({;\n]*?(?<![:\w])(\w+)(?:\(| =| ?\{)", re.MULTILINE)
KEPT = (*TAKES_A_WORD, "-std=", "-m", "-pthread")


def arguments_of(command):
    """Arguments of a compile command that decide the meaning of the source; warnings and optimisation are left out."""
    words = command.get("arguments") or shlex.split(command["command"])
    kept = [words[0]]
    rest = iter(words[1:])
    for word in rest:
        if word.startswith(KEPT):
            kept.append(word)
            if word in TAKES_A_WORD:
                kept.append(next(rest))
    return [*kept, command["file"]]


def of_build(build):
    """The first command of each source that the build compiles and CMake did not write, by the source's path."""
    found = {}
    for command in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        file = pathlib.Path(command["directory"], command["file"]).resolve()
        if file.suffix == ".cpp" and build.resolve() not in file.parents and file.is_relative_to(ROOT):
            found.setdefault(file, {"directory": command["directory"], "file": str(file),
                                    "arguments": arguments_of(command)})
    return found


def findings_in(program, database, source, files):
    """Findings in a source and in the files that it reads at once, empty where there are none."""
    config = ROOT / ".clang-tidy"
    headers = re.search(r"^HeaderFilterRegex: '(.*)'$", config.read_text(encoding="utf-8"), re.MULTILINE)[1]
    run = subprocess.run([program, "-p", str(database), "--quiet", f"--config-file={config}",
                          f"--header-filter={'|'.join([headers, *(re.escape(str(file)) for file in files)])}", str(source)],
                         capture_output=True, text=True, check=False)
    return "" if run.returncode == 0 else run.stdout or run.stderr


def names_of(file):
    """Names that a source defines at the beginning of a line; two sources with one of them are not read at once."""
    return set(DEFINED.findall(file.read_text(encoding="utf-8")))


def bundles(commands, files):
    """The files that are read alike, lie in one folder and share no name, a few at a time."""
    alike = {}
    for file in files:
        groups = alike.setdefault((file.parent, commands[file]["directory"], *commands[file]["arguments"][:-1]), [])
        names = names_of(file)
        group = next((one for one in groups if len(one[0]) < BUNDLE and not names & one[1]), None)
        if group is None:
            groups.append(([file], names))
        else:
            group[0].append(file)
            group[1].update(names)
    return [group for groups in alike.values() for group, _ in groups]


def findings_of(program, commands, files):
    """Findings in files that are read alike. They are read as one source, since most of the time goes into headers. If that is
    not clean, be it by two names that meet, each half is read again, down to single files, whose findings count."""
    with tempfile.TemporaryDirectory() as folder:
        source = files[0]
        if len(files) > 1:
            source = pathlib.Path(folder, "whole.cpp")
            source.write_text("".join(f'#include "{file}"  // NOLINT\n' for file in files), encoding="utf-8")
        command = {**commands[files[0]], "file": str(source)}
        command["arguments"] = [*command["arguments"][:-1], str(source)]
        pathlib.Path(folder, "compile_commands.json").write_text(json.dumps([command]), encoding="utf-8")
        found = findings_in(program, folder, source, files)
    if not found or len(files) == 1:
        return [found] if found else []
    half = len(files) // 2
    return findings_of(program, commands, files[:half]) + findings_of(program, commands, files[half:])


def check(program, commands, files, jobs):
    """Prints the findings of every file, returns how many files have any."""
    bad = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for found in pool.map(lambda bundle: findings_of(program, commands, bundle), bundles(commands, files)):
            bad += len(found)
            print("".join(found), end="", flush=True)
    return bad


def self_test(program):
    """A source with one planted finding of each kind, in it and in its header, and a clean one."""
    cases = {
        "clean.cpp": ("bool within(double a, double b) { return !(a > b); }  // NaN is within\n", 0),
        "name.cpp": ("int BadName() { return 1; }\n", 1),
        "defect.cpp": ("#include <string>\nvoid take(std::string s);\n"
                       "void twice(std::string s) { take(std::move(s)); take(s); }\n", 1),
        "broken.cpp": ("int f() { return missing; }\n", 1),
        "by_header.cpp": ('#include "core/header.hpp"\n', 1),
    }
    failed, commands = [], {}
    with tempfile.TemporaryDirectory() as folder:
        header = pathlib.Path(folder, "core/header.hpp")
        header.parent.mkdir()
        header.write_text("inline int BadName() { return 1; }\n", encoding="utf-8")
        clean = pathlib.Path(folder, "clean.cpp")
        for name, (text, expected) in cases.items():
            file = pathlib.Path(folder, name)
            file.write_text(text, encoding="utf-8")
            command = {"directory": folder, "file": str(file),
                       "command": f"c++ -std=c++20 -fvect-cost-model=dynamic -Wlogical-op -I {folder} -c {file}"}
            command["arguments"] = arguments_of(command)
            del command["command"]
            commands[file] = command
            for files in ([file], [clean, file]):
                found = findings_of(program, commands, files)
                if len(found) != expected:
                    failed.append(name)
                    print(f"self-test: {name} of {len(files)} gave {found or 'no finding'}")
    print(f"self-test: {len(cases)} cases, {len(failed)} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path, nargs="?")
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--under", nargs="+", default=FOLDERS, metavar="FOLDER")
    parser.add_argument("--self-test", action="store_true", help="check that planted findings are found")
    arguments = parser.parse_args()
    program = find("clang-tidy")
    skipped = 0 if arguments.files else SKIPPED
    if program is None:
        print(missing("clang-tidy"))
        return skipped
    if arguments.self_test:
        return self_test(program)
    if arguments.build is None:
        parser.error("BUILD is missing")
    if not (arguments.build / "compile_commands.json").is_file():
        print(f"SKIPPED: {arguments.build} has no compile_commands.json; nothing checked")
        return skipped
    commands = of_build(arguments.build)
    named = {file.resolve() for file in arguments.files}
    files = sorted(file for file in commands if file in named or
                   (not named and file.relative_to(ROOT).parts[0] in arguments.under))
    bad = check(program, commands, files, arguments.jobs)
    print(f"{len(files)} files, {bad} with findings")
    return 1 if bad or not (files or named) else 0


if __name__ == "__main__":
    sys.exit(main())
