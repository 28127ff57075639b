"""The pinned programs of the lint, and the sources they check."""

import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCE_SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".c"}
SKIPPED = 77  # CTest counts this exit status as skipped


def pinned(tool):
    """Version of `tool` that tools/requirements-lint.txt pins."""
    text = (ROOT / "tools/requirements-lint.txt").read_text(encoding="utf-8")
    return re.search(rf"^{tool}==([0-9.]+)$", text, re.MULTILINE)[1]


def find(tool):
    """Path of `tool` in its pinned version, beside this Python or on PATH, or None."""
    for program in (shutil.which(tool, path=str(pathlib.Path(sys.executable).parent)), shutil.which(tool)):
        if program:
            text = subprocess.run([program, "--version"], capture_output=True, text=True, check=False).stdout
            if re.search(rf"version {re.escape(pinned(tool))}\b", text):
                return program
    return None


def missing(tool):
    """Sentence that says how to get `tool`."""
    return f"SKIPPED: {tool} {pinned(tool)} is not here (pip install -r tools/requirements-lint.txt); nothing checked"


def sources():
    """C++ and CUDA sources that git knows, or those outside of build folders where there is no git."""
    listing = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=False)
    names = listing.stdout.splitlines() if listing.returncode == 0 and listing.stdout else [
        f.relative_to(ROOT).as_posix() for f in ROOT.rglob("*")
        if not f.relative_to(ROOT).parts[0].startswith(("build", "."))]
    return [ROOT / name for name in names
            if pathlib.PurePosixPath(name).suffix in SOURCE_SUFFIXES and (ROOT / name).is_file()]
