"""The pinned programs of the lint, the sources they check, and the frame of our own checks."""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCE_SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".c"}
SKIPPED = 77  # CTest counts this exit status as skipped


def pinned(tool):
    """Version of `tool` that tools/requirements-lint.txt pins."""
    text = (ROOT / "tools/requirements-lint.txt").read_text(encoding="utf-8")
    return re.search(rf"^{tool}==([0-9.]+)$", text, re.MULTILINE)[1]


def find(tool, version="--version"):
    """Path of `tool` in its pinned version, beside this Python or on PATH, or None. `version` makes it print its own."""
    for program in (shutil.which(tool, path=str(pathlib.Path(sys.executable).parent)), shutil.which(tool)):
        if program:
            text = subprocess.run([program, version], capture_output=True, text=True, check=False).stdout
            if re.search(rf"(^|version |^{tool} ){re.escape(pinned(tool))}\b", text, re.IGNORECASE):
                return program
    return None


def missing(tool):
    """Sentence on how to get `tool`."""
    return f"SKIPPED: {tool} {pinned(tool)} is not here (pip install -r tools/requirements-lint.txt); nothing checked"


def sources():
    """C++ and CUDA sources that git knows, or those outside of build folders where there is no git."""
    listing = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=False)
    names = listing.stdout.splitlines() if listing.returncode == 0 and listing.stdout else [
        f.relative_to(ROOT).as_posix() for f in ROOT.rglob("*")
        if not f.relative_to(ROOT).parts[0].startswith(("build", "."))]
    return [ROOT / name for name in names
            if pathlib.PurePosixPath(name).suffix in SOURCE_SUFFIXES and (ROOT / name).is_file()]


def run_check(description, check_tree, self_test):
    """A lint as a program: `--self-test`, or check_tree(root), which gives the number of files and the sentences to print.
    Returns the exit status, 1 where there is any or no file."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent.parent)
    parser.add_argument("--self-test", action="store_true", help="check that what is planted is found")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    count, problems = check_tree(arguments.root)
    for problem in problems:
        print(problem)
    print(f"{count} files, {len(problems)} problems")
    return 1 if problems or count == 0 else 0


def test_planted(check_tree, clean, planted):
    """Tests a lint on a small tree. `clean` has the text of each file, in which nothing is found.

    `planted` has (path, lines, expected), one at a time. The lines stand at the end of the file. The one sentence that is
    found has `expected` in it; None: nothing is found. Prints other findings, returns the exit status.
    """
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)

        def write(path, text):
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")

        for path, text in clean.items():
            write(path, text)
        failures += [f"a clean tree was reported: {problem}" for problem in check_tree(root)[1]]
        for path, lines, expected in planted:
            write(path, clean.get(path, "") + lines)
            problems = check_tree(root)[1]
            if len(problems) != (expected is not None) or any(expected not in problem for problem in problems):
                failures.append(f"planted '{lines}' in {path}, got {problems or 'nothing'}")
            if path in clean:
                write(path, clean[path])
            else:
                (root / path).unlink()
    for failure in failures:
        print(failure)
    print(f"self-test: {len(planted) + 1} cases, {len(failures)} failed")
    return 1 if failures else 0
