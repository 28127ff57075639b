#!/usr/bin/env python3
"""The manifest of a pack for a machine with a GPU (scripts/pack_for_gpu.sh): its sources and contents.

    pack_manifest.py sources                           the digest of the sources here
    pack_manifest.py write FOLDER [--sources DIGEST] [--note TEXT ...]
                                                       FOLDER/manifest.txt, of the sources here and the files there;
                                                       refuses if the sources have another digest by now
    pack_manifest.py check FOLDER                      does the pack fit the sources here? status 1, and what differs

The sources are all files of the library, the kernels and gpu_first that a compiler or CMake reads. A digest of their
digests stands for all of them: gpu_first writes it into its results.
"""

import argparse
import hashlib
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ["bench/support", "cmake", "core", "cpu_fallback", "cuda", "scenes", "tests/support", "tools/gpu_first"]
SUFFIXES = {".cmake", ".cpp", ".csv", ".cu", ".cuh", ".hpp", ".in", ".inc", ".sh"}
NAME = "manifest.txt"
TITLE = "stiction pack for a GPU 1"


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def sources(root):
    """{path: digest}."""
    files = [path for folder in FOLDERS for path in (root / folder).rglob("*")
             if path.is_file() and (path.suffix in SUFFIXES or path.name == "CMakeLists.txt")]
    return {str(path.relative_to(root)): digest(path) for path in [root / "CMakeLists.txt", *files]}


def joined(found):
    text = "".join(f"{value} {name}\n" for name, value in sorted(found.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def write(folder, notes, root=ROOT):
    found = sources(root)
    lines = [TITLE, f"sources {joined(found)}", *(f"note {note}" for note in notes)]
    lines += [f"source {value} {name}" for name, value in sorted(found.items())]
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != NAME)
    lines += [f"file {digest(path)} {path.relative_to(folder)}" for path in files]
    (folder / NAME).write_text("\n".join(lines) + "\n")
    return joined(found)


def check(folder, root=ROOT):
    """A sentence for each difference."""
    manifest = folder / NAME
    if not manifest.is_file() or not manifest.read_text().startswith(TITLE + "\n"):
        return [f"{folder} has no {NAME} of a pack"]
    made_of, files = {}, {}
    for line in manifest.read_text().splitlines():
        kind, _, rest = line.partition(" ")
        if kind in ("source", "file"):
            value, _, name = rest.partition(" ")
            (made_of if kind == "source" else files)[name] = value
    here = sources(root)
    problems = [f"{name} is {'not here' if name not in here else 'new' if name not in made_of else 'another'}"
                for name in sorted(made_of.keys() | here.keys()) if made_of.get(name) != here.get(name)]
    for name, value in files.items():
        path = folder / name
        if not path.is_file() or digest(path) != value:
            problems.append(f"{path} is {'another' if path.is_file() else 'not there'}")
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["sources", "write", "check"])
    parser.add_argument("folder", type=pathlib.Path, nargs="?")
    parser.add_argument("--sources", default="")
    parser.add_argument("--note", action="append", default=[])
    arguments = parser.parse_args()
    here = joined(sources(ROOT))
    if arguments.what == "sources":
        print(here)
        return 0
    if arguments.folder is None:
        parser.error("give a folder")
    if arguments.what == "write":
        if arguments.sources not in ("", here):
            print("pack_manifest.py: sources have changed since the program was begun: make the pack anew", file=sys.stderr)
            return 1
        print(f"sources {write(arguments.folder, arguments.note)}")
        return 0
    problems = check(arguments.folder)
    if problems:
        shown = problems[:5] + ([f"and {len(problems) - 5} more"] if len(problems) > 5 else [])
        print(f"pack_manifest.py: the pack in {arguments.folder} was made of other sources; make it anew by "
              "scripts/pack_for_gpu.sh, or remove it. Files that differ:\n  " + "\n  ".join(shown), file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
