#!/usr/bin/env python3
"""Looks in the CPU's objects for fused operations that were not written.

    check_fused.py [--objdump PROGRAM] [--linker PROGRAM] OBJECT ...
    check_fused.py --self-test

Only fma_() fuses (docs/explanation/numerics.md, rule 3), but compilers fuse in spite of -ffp-contract=off. GCC 12 does
where its vectoriser of straight-line code puts a sum and a difference of products side by side. Every fused
instruction of x86 or AArch64 is therefore looked up in the object's line table (-g1, which changes no instruction). An
instruction that a compiler fuses has the line of the sum, so a line with a binary + or - and without fma_() is a
finding. An instruction that fma_() requested keeps the line of fma_() or of its intrinsic. Or it has the line of a
negation or a selection merged into it, which round nothing. An alternating one (vfmaddsub, vfmsubadd) is a lapse
wherever it stands, since no body writes one. Exit status 1 on a finding or where there is no line table, 77 without
objdump, which CTest counts as skipped.
"""

import argparse
import collections
import concurrent.futures
import functools
import os
import pathlib
import posixpath
import re
import shutil
import struct
import subprocess
import sys
import tempfile

FUNCTION = re.compile(r"^[0-9a-f]+ <(.*)>:$")
LINE = re.compile(r"^(/\S+?):(\d+)(?: \(discriminator \d+\))?$")
FUSED = re.compile(r"\t(vfn?m(?:add|sub|addsub|subadd)[0-9]*[ps][sd]|fn?m(?:add|sub)|fml[as])\b")
ALTERNATING = re.compile(r"vfm(?:addsub|subadd)")
INTRINSICS = re.compile(r"/(?:(?:fma|avx512[a-z]*)intrin|arm_neon)\.h$")
WRITTEN = re.compile(r"\bfma_\(|__builtin_fmaf?\(")
SUM = re.compile(r"\s[+-]=?(?:\s|$)")  # clang-format puts spaces around binary operators
# Lines that GCC names for a fused operation which is written elsewhere, each read in the disassembly.
MISPLACED = {
    # The z of this difference is proximal_point()'s fma_(-step, y, z); its product a x is rounded before, by a vmulsd.
    "const Real r = ax[k] - z[k];",
}
SKIPPED = 77
TREE = pathlib.Path(__file__).resolve().parent.parent
ANY_CLONE = "/stiction/"  # how cmake/fp_policy.cmake has the tree named in an object


X86_64 = 62  # of ELF


def bytes_where(test):
    """A pattern of one byte."""
    return b"[" + b"".join(re.escape(bytes([value])) for value in range(256) if test(value)) + b"]"


def fused_bytes():
    """A pattern of how every fused operation of x86 begins: FMA3 by VEX or EVEX, or AMD's FMA4; its map, the prefix 66, its
    operation. Other bytes may look so, too."""
    prefix = bytes_where(lambda value: value & 3 == 1)
    operation = bytes_where(lambda value: value >> 4 in (9, 10, 11) and value & 15 >= 6)
    of_amd = bytes_where(lambda value: 0x5C <= value <= 0x5F or (value >> 4 in (6, 7) and value & 8))
    vex = b"\xc4" + bytes_where(lambda value: value & 31 == 2) + prefix
    evex = b"\x62" + bytes_where(lambda value: value & 7 == 2) + prefix + b"."
    fma4 = b"\xc4" + bytes_where(lambda value: value & 31 == 3) + prefix + of_amd
    return re.compile(b"(?:" + vex + b"|" + evex + b")" + operation + b"|" + fma4, re.DOTALL)


FUSED_BYTES = fused_bytes()


def in_tree(path):
    """The file that an object's line table names."""
    return TREE / posixpath.normpath(path)[len(ANY_CLONE):] if path.startswith(ANY_CLONE) else pathlib.Path(path)


@functools.lru_cache(maxsize=None)
def source(path):
    try:
        return in_tree(path).read_text(errors="replace").splitlines()
    except OSError:
        return []


def is_written(path, number, read=source):
    """Returns true if the line asks for a fused operation, or holds no sum that a compiler could have fused."""
    if INTRINSICS.search(path):
        return True
    lines = read(path)
    if not 0 < number <= len(lines):
        return False
    line = lines[number - 1].split("//")[0]
    return WRITTEN.search(line) is not None or SUM.search(line) is None or line.strip() in MISPLACED


def findings(text, label, read=source):
    """Fused instructions of a disassembly with line numbers, and those that were not written: (count, sentences)."""
    found, count, function, last = [], 0, "?", ""
    for line in text.splitlines():  # millions, and few are of interest: which kind a line is of shows without a pattern
        if line.startswith("/"):
            last = line
            continue
        if line.endswith(">:"):
            header = FUNCTION.match(line)
            if header:
                function, last = header.group(1), ""
            continue
        operation = FUSED.search(line) if "\tvf" in line or "\tf" in line else None
        if not operation:
            continue
        count += 1
        place = LINE.match(last)
        where = (place.group(1), int(place.group(2))) if place else None
        at = f"{where[0]}:{where[1]}" if where else "no line"
        if ALTERNATING.match(operation.group(1)):
            found.append(f"{label}: {operation.group(1)} in {function} ({at}): nothing alternating is ever written")
        elif where is None or not is_written(*where, read):
            found.append(f"{label}: {operation.group(1)} in {function} ({at}): a sum without fma_()")
    return count, found


def code_of(path):
    """(Machine code of each section of a 64-bit ELF object, its processor by ELF's number)."""
    elf = path.read_bytes()
    machine, begin, size, count = (struct.unpack_from(form, elf, at)[0]
                                   for form, at in (("<H", 18), ("<Q", 40), ("<H", 58), ("<H", 60)))
    count = count or struct.unpack_from("<Q", elf, begin + 32)[0]  # that many sections do not fit 16 bits
    code = []
    for header in range(begin, begin + count * size, size):
        kind, flags, _, at, length = struct.unpack_from("<IQQQQ", elf, header + 4)
        if kind == 1 and flags & 4:  # SHT_PROGBITS, SHF_EXECINSTR
            code.append(elf[at:at + length])
    return code, machine


def may_fuse(code, machine):
    """Returns false where no byte can begin a fused operation. A true answer may be bytes of something else."""
    return machine != X86_64 or any(FUSED_BYTES.search(section) for section in code)


def in_one_piece(path, folder, linker):
    """A library of the object alone, else the object. Most have a section for each of thousands of functions, among which objdump
    searches long for a line. The linker puts them into one, and changes no instruction but calls and loads of addresses."""
    whole = pathlib.Path(folder, "whole.so")
    command = [linker, "-shared", "-z", "notext", "--defsym=__dso_handle=0", "--unresolved-symbols=ignore-all", "-o", whole, path]
    try:
        done = subprocess.run(command, capture_output=True, check=False)
    except OSError:
        return path
    return whole if done.returncode == 0 else path


def look_at(path, objdump="objdump", linker="ld"):
    """The findings of one object. Disassembly takes long, and most objects have nothing fused."""
    if not may_fuse(*code_of(path)):
        return 0, []
    with tempfile.TemporaryDirectory() as folder:
        whole = in_one_piece(path, folder, linker)
        listing = subprocess.run([objdump, "--no-show-raw-insn", "-dl", whole], capture_output=True, text=True, check=True).stdout
    return findings(listing, path.name)


def self_test():
    sources = {"/s/real.hpp": ["double fma_(double a, double b, double c) {", "return __builtin_fma(a, b, c);"],
               "/s/body.hpp": ["x = a * b + c;", "x = fma_(a, b, c);", "return -dot(a, b);  // a - b", "x +="]}
    begin = "0000000000000000 <f>:\n"
    cases = [(begin + "/s/body.hpp:2\n   0:\tvfmsubadd132pd %xmm2,%xmm4,%xmm8\n", 1),
             (begin + "/s/body.hpp:2\n   0:\tvfmaddsub213ps %ymm2,%ymm4,%ymm8\n", 1),
             (begin + "/s/body.hpp:1\n   0:\tvfmadd213pd %ymm2,%ymm4,%ymm8\n", 1),
             (begin + "/s/body.hpp:1 (discriminator 3)\n   0:\tvfnmsub213sd %xmm2,%xmm4,%xmm8\n", 1),
             (begin + "   0:\tvfmadd213pd %ymm2,%ymm4,%ymm8\n", 1),
             (begin + "/s/body.hpp:2\n   0:\tvmulpd %ymm2,%ymm4,%ymm8\n0000000000000010 <g>:\n  10:\tvfmadd213ss %xmm2,%xmm4,%xmm8\n", 1),
             (begin + "/s/body.hpp:4\n   0:\tvfmadd213pd %ymm2,%ymm4,%ymm8\n", 1),
             (begin + "/s/body.hpp:9\n   0:\tvfmadd213pd %ymm2,%ymm4,%ymm8\n", 1),
             (begin + "/s/body.hpp:3\n   0:\tvfnmsub213pd %ymm2,%ymm4,%ymm8\n", 0),
             (begin + "/s/body.hpp:2\n   0:\tvfmadd213pd %ymm2,%ymm4,%ymm8\n", 0),
             (begin + "/s/real.hpp:2\n   0:\tvfnmadd231ss %xmm2,%xmm4,%xmm8\n", 0),
             (begin + "/usr/lib/gcc/x86_64-linux-gnu/12/include/fmaintrin.h:49\n   0:\tvfmadd213ps %ymm2,%ymm4,%ymm8\n", 0),
             (begin + "/s/body.hpp:1\n   0:\tfmadd\td0, d1, d2, d3\n", 1),
             (begin + "/s/body.hpp:1\n   0:\tfmls\tv0.4s, v1.4s, v2.4s\n", 1),
             (begin + "/s/body.hpp:2\n   0:\tfnmsub\ts0, s1, s2, s3\n", 0),
             (begin + "/usr/lib/gcc-cross/aarch64-linux-gnu/12/include/arm_neon.h:9\n   0:\tfmla\tv0.2d, v1.2d, v2.2d\n", 0),
             (begin + "/s/body.hpp:1\n   0:\tfmul\td0, d1, d2\n", 0),
             (begin + "/s/body.hpp:1\n   4:\tvaddsubpd %xmm1,%xmm2,%xmm3\n", 0)]
    failed = [text for text, expected in cases
              if len(findings(text, "planted", lambda path: sources.get(path, []))[1]) != expected]
    failed += [path for path in (ANY_CLONE + "tools/check_fused.py", ANY_CLONE + "build/../tools/check_fused.py")
               if in_tree(path) != pathlib.Path(__file__).resolve()]
    code = [("c4 62 dd a8 c2", True), ("62 62 5d 48 97 e2", True), ("c4 e2 59 bf 18", True), ("c4 e3 e1 69 e1 20", True),
            ("c4 41 5d 59 c4", False), ("c4 42 5d 16 c4", False), ("c4 e3 65 4b e2 10", False)]
    failed += [text for text, expected in code if may_fuse([b"\x90" + bytes.fromhex(text)], X86_64) != expected]
    for text in failed:
        print(f"self-test: wrong answer for {text!r}")
    print(f"self-test: {len(cases) + len(code) + 2} cases, {len(failed)} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--self-test", action="store_true", help="check that planted instructions are found")
    parser.add_argument("--objdump", default="objdump", help="the program that reads the objects")
    parser.add_argument("--linker", default="ld", help="the program that makes one piece of an object's code")
    parser.add_argument("objects", nargs="*", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    arguments.objects = [path for path in arguments.objects if path.suffix not in (".gch", ".pch")]  # precompiled headers
    if not arguments.objects:
        parser.error("no objects given")
    if shutil.which(arguments.objdump) is None:
        print(f"SKIPPED: {arguments.objdump} is missing: nothing was checked")
        return SKIPPED
    found, fused = collections.OrderedDict(), 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        looked_at = list(pool.map(functools.partial(look_at, objdump=arguments.objdump, linker=arguments.linker), arguments.objects))
    for count, sentences in looked_at:
        fused += count
        for sentence in sentences:
            found[sentence] = found.get(sentence, 0) + 1
    for sentence, times in found.items():
        print(f"{sentence}{f', {times} times' if times > 1 else ''}")
    print(f"{len(arguments.objects)} objects, {fused} fused operations, {sum(found.values())} not written as fma_()")
    return 1 if found or fused == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
