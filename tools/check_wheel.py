#!/usr/bin/env python3
"""Checks that a wheel runs on other machines: the demands of its modules on the system, and their contents.

    check_wheel.py --glibc 2.28 WHEEL.whl

Each module may need the C library up to that version, the loader, libgcc_s, and no other library. It has kernels for AVX2 and
AVX-512 (x86-64), reads files, and holds nothing of METIS or SuiteSparse. The licences of the contents are beside it.
Exit status 1 on a finding, 77 without readelf.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile

NEEDED = re.compile(r"\(NEEDED\)\s+Shared library: \[(.*)\]")
VERSION = re.compile(r"Name: (GLIBC|GLIBCXX|CXXABI|GCC)_([0-9.]+)")
SYSTEM = re.compile(r"(lib(c|m|dl|rt|pthread|gcc_s)\.so\.\d+|ld-linux-[a-z0-9-]+\.so\.\d+)$")  # of glibc; the unwinder
GCC = "7.0.0"  # of libgcc_s.so.1, as manylinux_2_28 has it
LICENCES = {"LICENSE", "LICENSE.hdf5", "LICENSE.zlib", "LICENSE.nanobind", "LICENSE.robin-map", "LICENSE.zig"}
INSIDE = {b"avx2": "kernels for AVX2", b"avx512": "kernels for AVX-512", b"HDF5 library version": "HDF5"}
OUTSIDE = {b"METIS_NodeND": "METIS", b"amd_order": "SuiteSparse"}


def version_of(text):
    return tuple(int(part) for part in text.split("."))


def findings_of_module(name, listing, contents, glibc, machine="x86_64"):
    """Sentences about one module: `listing` is readelf's output, `contents` its bytes."""
    found = [f"{name} needs {library}" for library in NEEDED.findall(listing) if not SYSTEM.match(library)]
    for kind, version in sorted(set(VERSION.findall(listing))):
        newest = {"GLIBC": glibc, "GCC": GCC}.get(kind)
        if newest is None or version_of(version) > version_of(newest):
            found.append(f"{name} needs {kind} {version}")
    if machine == "x86_64":
        found += [f"{name} is without {what}" for word, what in INSIDE.items() if word not in contents]
    return found + [f"{name} holds {what}" for word, what in OUTSIDE.items() if word in contents]


def findings_of_wheel(wheel, glibc):
    found, modules = [], 0
    with zipfile.ZipFile(wheel) as archive, tempfile.TemporaryDirectory() as folder:
        names = archive.namelist()
        licences = {pathlib.PurePosixPath(name).name for name in names if ".dist-info/" in name}
        found += [f"the licence {name} is missing" for name in sorted(LICENCES - licences)]
        for name in names:
            if re.search(r"\.so(\.|$)", name):
                modules += 1
                path = archive.extract(name, folder)
                listing = subprocess.run(["readelf", "--dynamic", "--version-info", "--wide", path], check=True,
                                         capture_output=True, text=True).stdout
                found += findings_of_module(name, listing, pathlib.Path(path).read_bytes(), glibc,
                                            "aarch64" if "aarch64" in wheel.name else "x86_64")
    return modules, found if modules else [*found, "there is no module"]


def self_test():
    inside = b" ".join(INSIDE)
    good = " 0x1 (NEEDED)  Shared library: [libm.so.6]\n  0x0010:   Name: GLIBC_2.27  Flags: none  Version: 2\n"
    cases = [(good, inside, 0), (good.replace("2.27", "2.29"), inside, 1), (good.replace("libm.so.6", "libmetis.so.5"), inside, 1),
             (good.replace("GLIBC_2.27", "GLIBCXX_3.4.30"), inside, 1), (good, b"avx2 HDF5 library version", 1),
             (good, inside + b"METIS_NodeND", 1)]
    failed = [case for case in cases if len(findings_of_module("m.so", case[0], case[1], "2.28")) != case[2]]
    for case in failed:
        print(f"self-test: wrong count for {case!r}")
    print(f"self-test: {len(cases)} cases, {len(failed)} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--self-test", action="store_true", help="check that planted lapses are found")
    parser.add_argument("--glibc", default="2.28", help="the newest version of the C library that may be asked for")
    parser.add_argument("wheel", nargs="?", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if arguments.wheel is None:
        parser.error("no wheel given")
    if shutil.which("readelf") is None:
        print("SKIPPED: readelf is missing: nothing was checked")
        return 77
    modules, found = findings_of_wheel(arguments.wheel, arguments.glibc)
    for sentence in found:
        print(sentence)
    print(f"{arguments.wheel.name}: {modules} modules, glibc {arguments.glibc}, {len(found)} findings")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
