#!/usr/bin/env python3
"""Packs nvcc's output for the kernels into one archive, with a manifest of its sources.

    prebuilt_cuda.py objects BUILD [--without cuda_pgs,...]    names of the objects of .cu files, for ninja
    prebuilt_cuda.py pack BUILD ARCHIVE.tar.xz --nvcc VERSION --architectures 90 [--without cuda_pgs,...]

A build with -DSTICTION_PREBUILT_CUDA=ARCHIVE takes the objects and compiles no .cu (cmake/prebuilt_cuda.cmake). It
compares every file of the manifest with its own, so objects of other sources are refused. The manifest names the
project's files in ninja's record of dependencies, and the files with the compiler's options. Kernels of sources that
--without names are left out: their objects then have catalogues without entries (tools/gpu_first/absent_launch.hpp).
"""

import argparse
import hashlib
import io
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile

ROOT = pathlib.Path(__file__).resolve().parents[1]
# Options that compile kernels. No record of dependencies names these.
SETTINGS = ["cmake/fp_policy.cmake", "cmake/stiction_add_solver.cmake", "cmake/solvers.cmake"]
GENERATED = "@build@/"
LAUNCH = "cuda/native/cuda_launch.cuh"
PRESET = 3  # of xz: a fifth larger than its default, in less than half of the time


def run(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def object_names(build):
    """Objects of .cu files, in ninja's names."""
    targets = run("ninja", "-C", build, "-t", "targets", "all")
    return sorted({name for name in re.findall(r"^(\S+\.cu\.o):", targets, re.MULTILINE)})


def sources_of(build, name, root=ROOT):
    """Files of the project that the object was made of; generated ones as @build@/..."""
    text = run("ninja", "-C", build, "-t", "deps", name)
    if "(VALID)" not in text.splitlines()[0]:
        raise SystemExit(f"prebuilt_cuda.py: {name} is not up to date: {text.splitlines()[0]}")
    found = set()
    for line in text.splitlines()[1:]:
        path = line.strip()
        if not path:
            continue
        whole = (build / path).resolve()
        if whole.is_relative_to(build.resolve()):
            found.add(GENERATED + str(whole.relative_to(build.resolve())))
        elif whole.is_relative_to(root):
            found.add(str(whole.relative_to(root)))
    return found


def flags_of(build, name):
    """The options of the compiler, without folders and files."""
    for entry in json.loads((build / "compile_commands.json").read_text()):
        if entry["command"].rstrip().endswith(pathlib.Path(name).name[:-2]) or name in entry["command"]:
            words = re.sub(r"\s-(I|isystem=?|o|c|x)\s*\S+", " ", " " + entry["command"]).split()
            return " ".join(word for word in words if word.startswith("-"))
    raise SystemExit(f"prebuilt_cuda.py: {name} is not in compile_commands.json")


def split(names, without):
    """(objects to compile, objects without kernels)."""
    stems = {pathlib.Path(name).name[:-len(".cu.o")]: name for name in names}
    unknown = without - stems.keys()
    if unknown:
        raise SystemExit(f"prebuilt_cuda.py: --without names {' '.join(sorted(unknown))}; there are {' '.join(sorted(stems))}")
    return [name for stem, name in stems.items() if stem not in without], [stems[stem] for stem in sorted(without)]


def compile_empty(build, name, folder):
    """The object of a source whose kernels are left out, compiled as C++."""
    entry = next(entry for entry in json.loads((build / "compile_commands.json").read_text()) if entry.get("output") == name
                 or name in entry["command"])
    text = pathlib.Path(entry["file"]).read_text()
    empty = text.replace(LAUNCH, "tools/gpu_first/absent_launch.hpp")
    if empty == text:
        raise SystemExit(f"prebuilt_cuda.py: {name} does not include {LAUNCH}: it cannot be left out")
    folder.mkdir(parents=True, exist_ok=True)
    source = folder / (pathlib.Path(name).name[:-len(".cu.o")] + ".cpp")
    source.write_text(empty)
    options = re.findall(r"-(?:I|D)\S+", entry["command"]) + [f"-isystem{path}" for path in re.findall(r"-isystem[= ]?(\S+)",
                                                                                                  entry["command"])]
    result = folder / pathlib.Path(name).name
    launcher = ["ccache"] if shutil.which("ccache") else []
    run(*launcher, "c++", "-std=c++20", "-O1", "-fPIC", "-w", *options, "-c", source, "-o", result)
    return result


def manifest(build, names, nvcc, architectures):
    sources = set(SETTINGS).union(*(sources_of(build, name) for name in names))
    lines = ["stiction prebuilt CUDA objects 1", f"nvcc {nvcc}", f"architectures {architectures}",
             *sorted({"flags " + flags_of(build, name) for name in names})]
    for name in sorted(sources):
        path = build / name[len(GENERATED):] if name.startswith(GENERATED) else ROOT / name
        lines.append(f"source {digest(path)} {name}")
    lines += [f"object {digest(build / name)} {pathlib.Path(name).name}" for name in names]
    return "\n".join(lines) + "\n"


def pack(build, archive, nvcc, architectures, without):
    names, left_out = split(object_names(build), without)
    missing = [name for name in names if not (build / name).exists()]
    if missing:
        raise SystemExit(f"prebuilt_cuda.py: not compiled yet: {' '.join(missing)}")
    empty = [compile_empty(build, name, build / "empty") for name in left_out]
    text = manifest(build, names, nvcc, architectures)
    text += "".join(f"object {digest(path)} {path.name}\n" for path in empty)
    archive.parent.mkdir(parents=True, exist_ok=True)
    part = archive.with_name(archive.name + ".part")
    with tarfile.open(part, "w:xz", preset=PRESET) as tar:
        info = tarfile.TarInfo("manifest.txt")
        info.size = len(text.encode())
        tar.addfile(info, io.BytesIO(text.encode()))
        for path in [build / name for name in names] + empty:
            tar.add(path, arcname=path.name)
    part.rename(archive)
    raw = sum((build / name).stat().st_size for name in names)
    print(f"{archive}: {len(names)} objects and {len(empty)} without kernels, {raw / 1e6:.1f} MB, in the archive {archive.stat().st_size / 1e6:.1f} MB")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["objects", "pack"])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("archive", type=pathlib.Path, nargs="?")
    parser.add_argument("--nvcc", default="")
    parser.add_argument("--architectures", default="90")
    parser.add_argument("--without", type=lambda text: set(filter(None, text.split(","))), default=set())
    arguments = parser.parse_args()
    if arguments.what == "objects":
        print("\n".join(split(object_names(arguments.build), arguments.without)[0]))
        return 0
    if arguments.archive is None or not arguments.nvcc:
        parser.error("pack needs an archive and --nvcc")
    pack(arguments.build, arguments.archive, arguments.nvcc, arguments.architectures, arguments.without)
    return 0


if __name__ == "__main__":
    sys.exit(main())
