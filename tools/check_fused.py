#!/usr/bin/env python3
"""Looks in the CPU's objects for operations that GCC fuses in spite of -ffp-contract=off.

    check_fused.py OBJECT ...
    check_fused.py --self-test

GCC 12 makes vfmaddsub and vfmsubadd of a sum and a difference of products that lie side by side (docs/numerics.md, rule
3). No body writes either, so one in an object is a lapse. Other fused operations are written as fma_() and look the same
as those that are not. Exit status 1 on a finding, 77 without objdump, which CTest counts as skipped.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys

FUNCTION = re.compile(r"^[0-9a-f]+ <(.*)>:$")
ALTERNATING = re.compile(r"\b(vfm(?:addsub|subadd)\w*)")
SKIPPED = 77


def findings(text, label):
    """Alternating fused operations in a disassembly."""
    found, function = [], "?"
    for line in text.splitlines():
        header = FUNCTION.match(line)
        if header:
            function = header.group(1)
            continue
        operation = ALTERNATING.search(line)
        if operation:
            found.append(f"{label}: {operation.group(1)} in {function}: compile this source with -fno-tree-slp-vectorize")
    return found


def self_test():
    cases = [("0000000000000000 <f>:\n   0:\tvfmsubadd132pd %xmm2,%xmm4,%xmm8\n", 1),
             ("0000000000000000 <f>:\n   0:\tvfmaddsub213ps %ymm2,%ymm4,%ymm8\n", 1),
             ("0000000000000000 <f>:\n   0:\tvfmadd213pd %ymm2,%ymm4,%ymm8\n   4:\tvaddsubpd %xmm1,%xmm2,%xmm3\n", 0)]
    failed = [text for text, count in cases if len(findings(text, "planted")) != count]
    for text in failed:
        print(f"self-test: wrong count for {text!r}")
    print(f"self-test: {len(cases)} cases, {len(failed)} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--self-test", action="store_true", help="check that planted instructions are found")
    parser.add_argument("objects", nargs="*", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if not arguments.objects:
        parser.error("no objects given")
    if shutil.which("objdump") is None:
        print("objdump is missing: nothing was checked")
        return SKIPPED
    found = []
    for path in arguments.objects:
        listing = subprocess.run(["objdump", "-dC", "--no-show-raw-insn", path], capture_output=True, text=True, check=True)
        found += findings(listing.stdout, path.name)
    for problem in found:
        print(problem)
    print(f"{len(arguments.objects)} objects, {len(found)} problems")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
