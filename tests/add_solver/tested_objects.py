#!/usr/bin/env python3
"""Objects of the tests' build that a further solver leaves as they are, for the copy of the tree that has one.

An object is taken where command and files are the same in both, but for optimisation and for the new enumerator. A further
enumerator moves SolverKind::end and the count of solvers, and a switch over solvers has to name it. An object that reads one of
those is compiled, as is everything with a text that differs.

As a program it is the compiler's launcher in the copy's build: it copies the object that the list names, else it compiles.

    tested_objects.py LIST COMPILER ARGUMENT ...
"""

import functools
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys

# Names that mean something else with one solver more. Only headers of the catalogue's machines and tables name the last.
CHANGED = re.compile(r"\bkSolverKindCount\b|\bSolverKind::(end|half)\b|\b(case|using enum) SolverKind\b|\bKernelCatalogue\b")
# A kernel includes these lines and takes nothing from them.
UNUSED = {
    "static_assert(kSolverKindCount <= 16 && 4 * kFallbackTurns <= 64);",
    "struct KernelCatalogue {",
    "std::array<SolverKernels, kSolverKindCount> solvers;",
}


def commands(source, build):
    """{object: words of its command} of a build, without optimisation and without the names of its folders."""
    found = {}
    for entry in json.loads((build / "compile_commands.json").read_text(encoding="utf-8")):
        # The build may lie in the source: its name goes first.
        words = shlex.split(entry["command"].replace(f"{build}/", "@build/").replace(f"{build} ", "@build ")
                            .replace(f"{source}/", "@source/").replace(f"{source} ", "@source "))
        name = words[words.index("-o") + 1]
        found[name] = [word for word in words if not re.fullmatch(r"-O\w", word)]
    return found


def read_files(build):
    """{object: files that it was made of} of a build by Ninja."""
    found, files = {}, []
    listing = subprocess.run(["ninja", "-C", str(build), "-t", "deps"], capture_output=True, text=True, check=False).stdout
    for line in listing.splitlines():
        if line.startswith("    "):
            files.append(os.path.normpath(build / line.strip()))
        else:
            files = []
            if line.endswith("(VALID)"):
                found[line.partition(": #deps")[0]] = files
    return found


def unchanged_objects(source, build, tree, copy_build, types):
    """{object of the copy's build: [the object of the tests' build, files of the copy that it depends on]}. `types` is the
    header with the enumerator, which is known to differ by that line alone."""
    if not (build / "compile_commands.json").is_file():
        return {}

    @functools.lru_cache(maxsize=None)
    def counterpart(name):
        """(The same file of the copy, or None where it differs or names what changes; when the file was written)."""
        file = pathlib.Path(name)
        written = file.stat().st_mtime
        for folder, other in ((build, copy_build), (source, tree)):
            if file.is_relative_to(folder):
                twin = other / file.relative_to(folder)
                break
        else:
            return name, 0  # of the system
        if twin == tree / types:
            return str(twin), written
        text = file.read_bytes()
        if file.suffix == ".gch":  # of the standard library alone
            twin = twin.with_suffix("")
            text = file.with_suffix("").read_bytes()
            if b'#include "' in text:
                return None, written
        lines = [line.partition("//")[0].strip() for line in text.decode(errors="replace").splitlines()]
        same = twin.is_file() and twin.read_bytes() == text
        named = any(CHANGED.search(line) for line in lines if line not in UNUSED)
        return str(twin) if same and not named else None, written

    found = {}
    wanted, files_of = commands(tree, copy_build), read_files(build)
    for name, words in commands(source, build).items():
        made = build / name
        files = files_of.get(name)
        if wanted.get(name) != words or not files or made.suffix == ".gch" or not made.is_file():
            continue
        twins = [counterpart(file) for file in files]
        if all(twin for twin, _ in twins) and max(written for _, written in twins) <= made.stat().st_mtime:
            found[name] = [str(made), [twin for twin, _ in twins]]
    return found


def main():
    name = sys.argv[sys.argv.index("-o") + 1]
    taken = json.loads(pathlib.Path(sys.argv[1]).read_text(encoding="utf-8")).get(name)
    if taken is None:
        return subprocess.run(sys.argv[2:], check=False).returncode
    made, files = taken
    shutil.copyfile(made, name)
    pathlib.Path(sys.argv[sys.argv.index("-MF") + 1]).write_text(f"{name}: {made} {' '.join(files)}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
