#!/usr/bin/env python3
"""Adds a solver to a copy of the tree, in the five places that docs/tutorials/writing_a_solver.md names, builds it and runs its test.

Header, enumerator and line of CMake are those that the page shows, so that the page is tested. Three new files and two new
lines must be all. Only the test's needs are built, for any x86-64 and not optimised; unchanged files of an earlier run
are kept. Objects that a further solver leaves as they are come from the tests' build (tested_objects.py). Exit status 1
on a finding.

    add_solver.py --source DIR --work DIR --cxx COMPILER [--tested DIR] [--launcher ccache] [--jobs N]
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

import tested_objects

LEFT_OUT = re.compile(r"(build|out|\.)[^/]*/|bench/results/|.*/__pycache__/|.*\.pyc$|\.[^/]*$")
PAGE = "docs/tutorials/writing_a_solver.md"
TYPES = "core/include/stiction/types.hpp"
LIST = "cmake/solvers.cmake"
NEW_PAGE = """# Half steps

[`half.hpp`](../../core/algorithm/solver/half.hpp): x_c ← P( x_c − (1/2) (1/D_c) (y_c + s_c) ) for all cones at once, then y = A x + b.
"""
OPTIONS = ["-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_CXX_FLAGS_DEBUG=-O0 -DNDEBUG", "-DSTICTION_ENABLE_CUDA=OFF", "-DSTICTION_ENABLE_AVX2=OFF",
           "-DSTICTION_ENABLE_TBB=OFF", "-DSTICTION_BUILD_TESTS=ON", "-DSTICTION_BUILD_TOOLS=OFF", "-DSTICTION_BUILD_BENCH=OFF",
           "-DSTICTION_BUILD_EXAMPLES=OFF", "-DSTICTION_BUILD_PYTHON=OFF", "-DSTICTION_WARNINGS_AS_ERRORS=ON",
           *(f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in ("HDF5", "Eigen3", "rapidcheck", "TBB"))]
TARGETS = ["algorithm_test_half", "c_api/CMakeFiles/stiction_c.dir/solver_kind.cpp.o"]


def tree_files(source):
    """Names of the files of a checkout, with git or without, that a build may read."""
    listing = subprocess.run(["git", "-C", str(source), "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                             capture_output=True, check=False)
    names = [name for name in listing.stdout.decode().split("\0") if name] if listing.returncode == 0 else []
    if not names:
        names = [file.relative_to(source).as_posix() for file in source.rglob("*") if file.is_file()]
    return {name for name in names if not LEFT_OUT.match(name) and (source / name).is_file()}


def block(page, language, line):
    """The code block of the page that has such a line."""
    blocks = [re.sub(rf"^{indent}", "", text, flags=re.M)
              for indent, text in re.findall(rf"^( *)```{language}\n(.*?)^\1```", page, re.M | re.S)]
    found = [text for text in blocks if re.search(line, text, re.M)]
    if len(found) != 1:
        sys.exit(f"{PAGE} has {len(found)} blocks of {language} with a line like {line}; one is expected")
    return found[0]


def with_line_after(text, pattern, line):
    """The text with that line after the last one that begins so."""
    last = list(re.finditer(rf"{pattern}[^\n]*\n", text, re.M))[-1].end()
    return text[:last] + line + text[last:]


def changed_tree(source):
    """({name: bytes} of the tree with the solver, the names that differ from the source's)."""
    files = {name: (source / name).read_bytes() for name in tree_files(source)}
    before = dict(files)
    page = files[PAGE].decode()
    types = files[TYPES].decode()
    next_number = 1 + max(int(n) for n in re.findall(r"^  \w+ = (\d+),", types, re.M) if int(n) < 253)
    enumerator = re.sub(r"= \d+", f"= {next_number}", block(page, "cpp", r"^  half = \d+,"))
    files["core/algorithm/solver/half.hpp"] = block(page, "cpp", r"^struct Half \{").encode()
    files["docs/math/half.md"] = NEW_PAGE.encode()
    files["tests/algorithm/test_half.cpp"] = (source / "tests/add_solver/test_half.cpp").read_bytes()
    files[TYPES] = with_line_after(types, rf"^  \w+ = {next_number - 1},", enumerator).encode()
    files[LIST] = with_line_after(files[LIST].decode(), r"^stiction_add_solver\(",
                                  block(page, "cmake", r"^stiction_add_solver\(half Half\)$")).encode()
    new = sorted(files.keys() - before.keys())
    edited = {name: files[name].count(b"\n") - before[name].count(b"\n") for name in before if files[name] != before[name]}
    if len(new) != 3 or edited != {TYPES: 1, LIST: 1}:
        sys.exit(f"more than three new files and two new lines: {new}, {edited}")
    return files


def write_tree(files, root):
    """Makes `root` these files and no others. Unchanged files keep their time."""
    for file in [file for file in root.rglob("*") if file.is_file()]:
        if file.relative_to(root).as_posix() not in files:
            file.unlink()
    for name, content in files.items():
        file = root / name
        if not file.is_file() or file.read_bytes() != content:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)


def run(what, command, **more):
    begin = time.monotonic()
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **more)
    print(f"{what}: {time.monotonic() - begin:.0f} s", flush=True)
    if done.returncode != 0:
        sys.exit("\n".join([f"{what} failed: {' '.join(map(str, command))}", *done.stdout.splitlines()[-80:]]))
    return done.stdout


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--source", type=pathlib.Path, required=True)
    parser.add_argument("--work", type=pathlib.Path, required=True, help="folder for the copy and its build")
    parser.add_argument("--cxx", required=True)
    parser.add_argument("--tested", type=pathlib.Path, help="build folder of the tests")
    parser.add_argument("--launcher", default=shutil.which("ccache") or "")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    arguments = parser.parse_args()
    source, work = arguments.source.resolve(), arguments.work.resolve()
    tree, build, taken = (work / name for name in ("tree", "build", "taken.json"))
    write_tree(changed_tree(source), tree)
    # The rules of includes bind the new solver, too.
    run("lint", [sys.executable, tree / "tools/lint_includes.py"])
    launcher = ";".join(filter(None, (sys.executable, tested_objects.__file__, str(taken), arguments.launcher)))
    run("configure", ["cmake", "-S", tree, "-B", build, "-G", "Ninja", f"-DCMAKE_CXX_COMPILER={arguments.cxx}",
                      f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}", *OPTIONS])
    objects = {}
    if arguments.tested:
        objects = tested_objects.unchanged_objects(source, arguments.tested.resolve(), tree, build, TYPES)
    earlier = json.loads(taken.read_text(encoding="utf-8")) if taken.is_file() else {}
    for name in earlier.keys() - objects.keys():  # compiled from here on
        (build / name).unlink(missing_ok=True)
    taken.write_text(json.dumps(objects), encoding="utf-8")
    print(f"objects that the tests' build has: {len(objects)}")
    environment = {"CCACHE_BASEDIR": str(work), "CCACHE_SLOPPINESS": "pch_defines,time_macros", **os.environ}
    run("build", ["cmake", "--build", build, "--parallel", str(arguments.jobs), "--target", *TARGETS], env=environment)
    if not re.search(r"^  STICTION_SOLVER_HALF = \d+,", (build / "c_api/include/stiction_solver_kinds.h").read_text(), re.M):
        sys.exit("the C interface has no number for it")
    if "algorithm_test_torture_half" not in run("list of tests", ["ctest", "--test-dir", build, "-N"]):
        sys.exit("there is no torture test of it")
    print(run("test", [build / "tests/algorithm_test_half"]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
