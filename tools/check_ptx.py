#!/usr/bin/env python3
"""Reads the PTX in the objects of the CUDA build and checks that every float operation rounds once, to nearest, where it
is written.

    check_ptx.py --compile-commands BUILD/compile_commands.json --arch 80 --arch 90 OBJECT ...
    check_ptx.py FILE.ptx ...                                   PTX that nvcc -ptx wrote
    check_ptx.py --self-test

The PTX that is checked is the text from which ptxas made the machine code beside it. Nothing is compiled again, and no
GPU is needed. Every object must hold PTX for every architecture named, with every kernel of its machine code. The
compile commands show the flags, which PTX does not. Why these rules: docs/explanation/numerics.md. Exit status 1 on a
finding.
"""

import argparse
import json
import os
import pathlib
import re
import shlex
import struct
import sys

import fatbin
import ptx_zero_signs

FLOAT = r"(?:f16|f16x2|bf16|bf16x2|f32|f32x2|tf32|f64)"
INSTRUCTION = re.compile(r"^\s*(?:@!?%?\w+\s+)?([a-z][a-z0-9_]*(?:\.[A-Za-z0-9_:]+)+)")
ENTRY = re.compile(r"^\s*(?:\.visible\s+|\.weak\s+)?\.entry\s+(\w+)", re.M)
FUNCTION = re.compile(r"\.(?:entry|func)\s+(?:\([^)]*\)\s*)?(\w+)")
ROUNDED = {"add", "sub", "mul", "mad", "fma", "div", "sqrt", "rcp"}
APPROXIMATE = {"rsqrt", "sin", "cos", "ex2", "lg2", "tanh"}
REQUIRED_FLAGS = ["--fmad=false", "--prec-div=true", "--prec-sqrt=true", "--ftz=false", "-ffp-contract=off"]
MATRIX = {"mma", "wmma", "wgmma", "tcgen05"}


# select(x > c, x, c) with a literal c >= +0, which nvcc writes as a maximum with c: the same bits for every x. If x is
# NaN both give c, because PTX returns the number when one operand is NaN. If x is a zero both give c, because PTX
# orders -0 below +0. Elsewhere there is nothing to choose. The same holds for select(x < c, x, c) and a literal c > 0,
# where a zero x is returned by both. With c = +0 the sign of a zero may differ, which ptx_zero_signs.py follows. A
# register or a negative literal is not as safe.
LITERAL_EXTREME = re.compile(r"\bm(?:ax|in)\.(?:f32\s+%\w+,\s*%\w+,\s*0f([0-9A-Fa-f]{8})|f64\s+%\w+,\s*%\w+,\s*0d([0-9A-Fa-f]{16}));")


# LLVM writes NaN in place of a number that it takes for undefined. nvcc 13.0 did so with one that had been stored
# (cuda/README.md). Final residuals meet a number of rows with kinds that have others, on paths that no cone takes.
LITERAL = re.compile(r"\b0(?:f([0-9A-Fa-f]{8})|d([0-9A-Fa-f]{16}))\b")
PATHS_OF_NO_CONE = "final_residual"
UNDEFINED = "takes a number that nvcc holds for undefined"


def has_literal_nan(line):
    """Returns true if an operand of a line of PTX is a literal NaN."""
    return any(int(single or "0", 16) & 0x7FFFFFFF > 0x7F800000 or int(double or "0", 16) & (1 << 63) - 1 > 0x7FF << 52
               for single, double in LITERAL.findall(line))


def is_select_with_literal(line):
    """Returns true if a line of PTX is a maximum or a minimum with a finite literal >= +0."""
    match = LITERAL_EXTREME.search(line)
    if not match:
        return False
    if match.group(1):
        return int(match.group(1), 16) < 0x7F800000
    return int(match.group(2), 16) < 0x7FF0000000000000


def finding(operation, line=""):
    """Returns the fault of one instruction such as `add.f32`, in its line of PTX, or None."""
    if is_select_with_literal(line):
        return None
    parts = operation.split(".")
    name, modifiers = parts[0], parts[1:]
    is_float = any(re.fullmatch(FLOAT, m) for m in modifiers)
    if name in MATRIX:
        return "a matrix instruction sums in an order of its own"
    if not is_float:
        return None
    if "ftz" in modifiers:
        return "flushes denormals to zero"
    if "approx" in modifiers or "full" in modifiers:
        return "is an approximation"
    if name in APPROXIMATE:
        return "has no correctly rounded result"
    if name in {"min", "max"}:
        return "treats -0 and NaN unlike the host"
    if name in {"atom", "red"} and "add" in modifiers:
        return "adds floats in the order of arrival"
    if name in ROUNDED and "rn" not in modifiers:
        return "carries no .rn, so ptxas may fuse it or it rounds another way"
    if name in ROUNDED and has_literal_nan(line):
        return UNDEFINED
    return None


def check_text(text, label):
    """Findings in one PTX text, and how many float operations were seen."""
    problems = []
    function = "?"
    seen = 0
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.split("//")[0]
        header = FUNCTION.search(line)
        if header:
            function = header.group(1)
        match = INSTRUCTION.match(line)
        if not match:
            continue
        operation = match.group(1)
        if operation.split(".")[0] in ROUNDED and re.search(rf"\.{FLOAT}$", operation):
            seen += 1
        problem = finding(operation, line)
        if problem == UNDEFINED and PATHS_OF_NO_CONE in function:
            continue
        if problem:
            problems.append(f"{label}:{number}: {operation} in {function}: {problem}")
    problems += [f"{label}:{number}: {operation} in {function}: is reached by a zero whose sign min(x, +0) left open"
                 for number, operation, function in ptx_zero_signs.reached(text)]
    return problems, seen


def flag_problem(command):
    """Returns the flags that the floating-point policy misses in a command, or None. Not seen in the PTX: a product
    and a sum that nvcc fused on its own look like an fma that was written."""
    text = " ".join(command)
    missing = [flag for flag in REQUIRED_FLAGS if flag not in text]
    if missing:
        return f"is compiled without {' '.join(missing)}"
    return "is compiled with fast math" if re.search(r"fast.math|-Ofast", text) else None


def object_commands(database):
    """{object: words of the command that makes it}."""
    commands = {}
    for entry in json.loads(database.read_text()):
        words = entry.get("arguments") or shlex.split(entry["command"])
        if "-o" in words:
            commands[os.path.realpath(os.path.join(entry["directory"], words[words.index("-o") + 1]))] = words
    return commands


def object_texts(data, label, archs):
    """([(label, PTX)], problems) of one object."""
    texts, problems = [], []
    ptx = fatbin.images(data, label, fatbin.PTX)
    machine = fatbin.images(data, label, fatbin.ELF)
    for arch in archs:
        text = "\n".join(fatbin.ptx_text(image) for image in ptx if image.arch == arch)
        entries = set(ENTRY.findall(text))
        if not entries:
            problems.append(f"{label}: no kernel's PTX for compute_{arch} is in it")
            continue
        texts.append((f"{label}/compute_{arch}", text))
        for image in machine:
            if image.arch == arch:
                missing = {kernel.name for kernel in fatbin.kernels(image.payload, label)} - entries
                problems += [f"{label}: {name} has machine code for sm_{arch} and no PTX" for name in sorted(missing)]
    return texts, problems


def read_objects(objects, database, archs):
    """([(label, PTX)], problems) of the objects and the commands that made them."""
    commands = object_commands(database)
    texts, problems = [], []
    for path in objects:
        command = commands.get(os.path.realpath(path))
        if command is None:
            problems.append(f"{path}: not in {database}; is it compiled by the build?")
            continue
        problem = flag_problem(command)
        if problem:
            problems.append(f"{path.name}: {problem}")
        try:
            found, missing = object_texts(path.read_bytes(), path.name, archs)
            texts += found
            problems += missing
        except (OSError, fatbin.FatbinError) as error:
            problems.append(str(error))
    return texts, problems


SELF_TEST = [
    ("add.rn.f32 \t%f3, %f1, %f2;", True),
    ("fma.rn.f64 %fd1, %fd2, %fd3, %fd4;", True),
    ("div.rn.f32 %f1, %f2, %f3;", True),
    ("sqrt.rn.f64 %fd1, %fd2;", True),
    ("@%p1 mul.rn.f32 %f1, %f2, %f3;", True),
    ("add.s64 %rd1, %rd2, %rd3;", True),
    ("mul.wide.s32 %rd1, %r1, 4;", True),
    ("mad.lo.s32 %r1, %r2, %r3, %r4;", True),
    ("max.s32 %r1, %r2, %r3;", True),
    ("setp.lt.f32 %p1, %f1, %f2;", True),
    ("selp.f32 %f1, %f2, %f3, %p1;", True),
    ("ld.global.nc.f32 %f1, [%rd1];", True),
    ("neg.f32 %f1, %f2;", True),
    ("cvt.rn.f32.f64 %f1, %fd1;", True),
    ("atom.global.add.u64 %rd1, [%rd2], %rd3;", True),
    ("shfl.sync.bfly.b32 %r1|%p1, %r2, 16, 31, -1;", True),
    ("max.f32 \t%f559, %f558, 0f00000000;", True),
    ("max.f64 %fd1, %fd2, 0d0000000000000000;", True),
    ("max.f32 %f1, %f2, 0f3F800000;", True),
    ("max.f64 %fd1, %fd2, 0d01A56E1FC2F8F359;", True),
    ("// add.f32 in a comment", True),
    ("selp.f32 %f1, 0f7FC00000, 0f00000000, %p1;", True),
    ("add.rn.f64 %fd1, %fd2, 0dFFF0000000000000;", True),
    ("add.rn.f32 %f1, %f2, 0f7FC00000;", False),
    ("mul.rn.f64 %fd1, 0d7FF8000000000000, %fd2;", False),
    ("add.f32 %f1, %f2, %f3;", False),
    ("@!%p2 sub.f64 %fd1, %fd2, %fd3;", False),
    ("mul.f32 %f1, %f2, %f3;", False),
    ("mul.rz.f32 %f1, %f2, %f3;", False),
    ("add.rn.ftz.f32 %f1, %f2, %f3;", False),
    ("setp.lt.ftz.f32 %p1, %f1, %f2;", False),
    ("div.full.f32 %f1, %f2, %f3;", False),
    ("div.approx.f32 %f1, %f2, %f3;", False),
    ("sqrt.approx.ftz.f32 %f1, %f2;", False),
    ("rcp.approx.ftz.f64 %fd1, %fd2;", False),
    ("rsqrt.approx.f32 %f1, %f2;", False),
    ("ex2.approx.f32 %f1, %f2;", False),
    ("sin.approx.f32 %f1, %f2;", False),
    ("min.f32 %f1, %f2, %f3;", False),
    ("min.f32 %f1, %f2, 0f00000000;", True),
    ("min.f64 %fd1, %fd2, 0d7E70000000000000;", True),
    ("min.f32 %f1, %f2, 0f80000000;", False),
    ("min.f32 %f1, %f2, 0f7FC00000;", False),
    ("min.f32 %f1, %f2, 0fBF800000;", False),
    ("min.NaN.f32 %f1, %f2, 0f3F800000;", False),
    ("max.f32 %f1, %f2, 0f80000000;", False),
    ("max.f32 %f1, %f2, %f3;", False),
    ("max.f32 %f1, %f2, 0fBF800000;", False),
    ("max.f32 %f1, %f2, 0f7F800000;", False),
    ("max.f32 %f1, %f2, 0f7FC00000;", False),
    ("max.f64 %fd1, %fd2, 0dBFF0000000000000;", False),
    ("max.f64 %fd1, %fd2, 0d7FF8000000000000;", False),
    ("max.NaN.f32 %f1, %f2, 0f00000000;", False),
    ("max.NaN.f64 %fd1, %fd2, %fd3;", False),
    ("atom.global.add.f32 %f1, [%rd1], %f2;", False),
    ("red.global.gpu.add.f64 [%rd1], %fd1;", False),
    ("wmma.mma.sync.aligned.row.col.m16n16k16.f32.f32 {%f1}, {%r1};", False),
]


def planted_object(texts):
    """An object that holds PTX."""
    body = b""
    for arch, text in texts:
        payload = text.encode() + b"\0\0"
        body += struct.pack("<HHIQ12xI24x", fatbin.PTX, 0x101, 56, len(payload), int(arch)) + payload
    return b"object" + struct.pack("<IHHQ", fatbin.FATBIN_MAGIC, 1, 16, len(body)) + body


def self_test():
    failed = 0
    for line, good in SELF_TEST:
        problems, _ = check_text(f".visible .entry kernel()\n{{\n{line}\n}}\n", "planted.ptx")
        if bool(problems) == good:
            print(f"self-test: '{line}' should be {'clean' if good else 'found'}, got {problems}")
            failed += 1
    for wrong in ptx_zero_signs.self_test():
        print(f"self-test: {wrong}")
        failed += 1
    flags = ["nvcc", *REQUIRED_FLAGS]
    for command, good in [(flags, True), (flags[:1] + flags[2:], False), (flags + ["-use_fast_math"], False),
                          (flags + ["-Ofast"], False), (flags + ["-Ofc=mid"], True)]:
        if (flag_problem(command) is None) != good:
            print(f"self-test: {command} should be {'clean' if good else 'found'}")
            failed += 1
    text = ".version 9.0\n.visible .entry k(\n)\n{\nadd.rn.f32 %f3, %f1, %f2;\n}\n"
    one = planted_object([("90", text)])
    for what, data, archs, good in [("one architecture", one, ["90"], True), ("an architecture too few", one, ["80", "90"], False),
                                    ("two", planted_object([("80", text), ("90", text)]), ["80", "90"], True),
                                    ("no kernel", planted_object([("90", ".version 9.0\n")]), ["90"], False),
                                    ("no device code", b"object", ["90"], False)]:
        texts, problems = object_texts(data, "planted.o", archs)
        if bool(problems) == good or (good and [t for _, t in texts] != [text] * len(archs)):
            print(f"self-test: {what}: {problems}, {texts}")
            failed += 1
    print(f"self-test: {len(SELF_TEST) + 8} cases, {failed} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--self-test", action="store_true", help="check that planted instructions are found")
    parser.add_argument("--compile-commands", type=pathlib.Path, help="the build's compile_commands.json")
    parser.add_argument("--arch", action="append", help="compute capability that every object holds, as 90")
    parser.add_argument("files", nargs="*", type=pathlib.Path, help="PTX files, or objects with --compile-commands")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if not arguments.files:
        parser.error("no files given")
    if arguments.compile_commands:
        if not arguments.arch:
            parser.error("--arch is needed with objects")
        texts, problems = read_objects(arguments.files, arguments.compile_commands, arguments.arch)
    else:
        texts, problems = [(file.name, file.read_text()) for file in arguments.files], []
    operations = entries = 0
    for label, text in texts:
        found, seen = check_text(text, label)
        problems += found
        operations += seen
        entries += len(ENTRY.findall(text))
    for problem in problems[:200]:
        print(problem)
    print(f"{len(texts)} PTX texts, {entries} kernels, {operations} rounded float operations, {len(problems)} problems")
    if operations == 0:
        print("no float operation was seen at all: the kernels are missing from the PTX")
    return 1 if problems or operations == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
