#!/usr/bin/env python3
"""Checks that a folder's cache of options does not count when a script configures. `begin_options` in scripts/common.sh
passes every option of the build at CMake's own default. Every script that configures begins with it.

    tools/lint_options.py
    tools/lint_options.py --self-test
"""

import pathlib
import re
import sys
import tempfile

import lint_tools

OPTION = re.compile(r'^ *option\((STICTION_\w+)\s+"[^"]*"\s+([^)\s]+)\)', re.M)
CACHED = re.compile(r'^ *set\((STICTION_\w+)\s+("[^"]*"|[^\s"]+)\s+CACHE (?!INTERNAL)', re.M)
PASSED = re.compile(r"-D(STICTION_\w+)(?::\w+)?=([^\s\")]*)")
BEGIN = re.compile(r"^begin_options\(\) \{\n(.*?)^\}", re.M | re.S)
VALUES = {"${STICTION_IS_TOP_LEVEL}": "ON"}


def declared(root):
    """{option: its default} of all CMake files but those of projects of their own and of toolchains."""
    found = {}
    for pattern in ("CMakeLists.txt", "*/CMakeLists.txt", "*/*/CMakeLists.txt", "cmake/*.cmake", "tests/*.cmake"):
        for file in root.glob(pattern):
            if file.parts[len(root.parts)].startswith("build") or file.name.startswith("toolchain"):
                continue
            text = file.read_text(encoding="utf-8")
            for name, value in OPTION.findall(text) + CACHED.findall(text):
                found[name] = VALUES.get(value, value.strip('"'))
    return found


def check_tree(root):
    """The number of scripts, and a sentence for each problem."""
    scripts = sorted((root / "scripts").glob("*.sh"))
    wanted = declared(root)
    begin = BEGIN.search((root / "scripts/common.sh").read_text(encoding="utf-8"))
    passed = dict(PASSED.findall(begin.group(1) if begin else ""))
    problems = [f"scripts/common.sh: begin_options passes no {name}" for name in sorted(wanted.keys() - passed.keys())]
    problems += [f"scripts/common.sh: begin_options passes {name}, which no CMake file has"
                 for name in sorted(passed.keys() - wanted.keys())]
    for name in sorted(wanted.keys() & passed.keys()):
        if "$" not in wanted[name] + passed[name] and wanted[name] != passed[name]:
            problems.append(f"scripts/common.sh: begin_options passes {name}={passed[name]}, "
                            f"CMake's default is {wanted[name]}")
    for script in scripts:
        text = script.read_text(encoding="utf-8").replace(begin.group(0) if begin else "", "")
        if re.search(r'-S "\$root"(?!/)', text):
            problems.append(f"scripts/{script.name}: configures without begin_options")
    return len(scripts), problems


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "scripts").mkdir()
        (root / "CMakeLists.txt").write_text(
            'option(STICTION_A "a" ON)\noption(STICTION_B "b" ${STICTION_IS_TOP_LEVEL})\n'
            'set(STICTION_C all CACHE STRING\n    "c")\nset(STICTION_D "" CACHE STRING "d")\n'
            'set(STICTION_E "${PROJECT_SOURCE_DIR}/x" CACHE PATH "e")\nset(STICTION_HAS_F ON)\n', encoding="utf-8")
        common = ('begin_options() {\n  options=(-S "$root" -B "$1" -DSTICTION_A=ON -DSTICTION_B=ON -DSTICTION_C=all\n'
                  '    -DSTICTION_D= "-DSTICTION_E:PATH=$root/x")\n}\n')
        (root / "scripts/common.sh").write_text(common, encoding="utf-8")
        (root / "scripts/good.sh").write_text('begin_options "$build"\ncmake -S "$root/tests" -B x\n', encoding="utf-8")
        good = check_tree(root)
        wrong = common.replace("-DSTICTION_A=ON ", "").replace("C=all", "C=native -DSTICTION_G=1")
        (root / "scripts/common.sh").write_text(wrong, encoding="utf-8")
        (root / "scripts/bad.sh").write_text('cmake -S "$root" -B x\n', encoding="utf-8")
        bad = check_tree(root)
    expected = ["scripts/common.sh: begin_options passes no STICTION_A",
                "scripts/common.sh: begin_options passes STICTION_G, which no CMake file has",
                "scripts/common.sh: begin_options passes STICTION_C=native, CMake's default is all",
                "scripts/bad.sh: configures without begin_options"]
    right = good == (2, []) and bad == (3, expected)
    print("self-test: right" if right else f"self-test: found {good} and {bad}")
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
