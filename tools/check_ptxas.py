#!/usr/bin/env python3
"""Compares the needs of every kernel's machine code with its limits in cuda/native/kernel_budget.csv.

    check_ptxas.py --budget BUDGET.csv --compiler VERSION --arch 80 --arch 90 OBJECT ...
    check_ptxas.py ... --update             writes the table anew
    check_ptxas.py --self-test

Registers, stack and barriers are read from the objects of the build. Counted in them are all instructions, accesses to
a thread's stack, generic accesses and matches. Nothing is compiled and no GPU is needed. The table is there because a kernel that suddenly needs a stack or twice the code is
slow. Nothing else shows it on a machine without a GPU. Exit status 1 on a finding, 77 if there is no table, or one of
another compiler or architecture.
"""

import argparse
import csv
import io
import pathlib
import re
import struct
import subprocess
import sys

import fatbin

HEADER = ["kernel", "arch", "registers", "stack", "barriers", *fatbin.OPERATIONS, "instructions"]
# Allowance of a kernel beyond its line: a share for numbers that move with any change, nothing for costly ones.
ALLOWANCE = {"registers": 0.1, "stack": 0.0, "barriers": 0.0, **dict.fromkeys(fatbin.OPERATIONS, 0.1), "instructions": 0.1}
ENUMERATORS = {"Law": ["convex", "coulomb", "boxed"], "EnvPath": ["empty", "dense", "sparse", "factor"]}


def readable(names):
    """Demangled names without the parts common to all kernels: `run_teams<Program>` is its program."""
    run = subprocess.run(["c++filt"], input="\n".join(names), capture_output=True, text=True, check=True)
    short = []
    for name in run.stdout.splitlines()[:len(names)]:
        name = re.sub(r"\(anonymous namespace\)::|_GLOBAL__N__\w+::|stiction::|isa_cuda::|cuda::", "", name)
        name = re.sub(r"^void (?=run_teams<)", "", name)
        name = re.sub(r"\([^()]*(\([^()]*\)[^()]*)*\)$", "", name)
        name = re.sub(r"^run_teams<(.*)>$", r"\1", name).strip()
        # c++filt writes an enumerator as its number behind its type.
        name = re.sub(r"\((Law|EnvPath)\)(\d)", lambda m: ENUMERATORS[m.group(1)][int(m.group(2))], name)
        short.append(name)
    return short


def read_objects(objects, archs):
    """({(kernel, arch): fatbin.Kernel}, bytes of machine code by architecture, problems)."""
    found, sizes, problems = {}, dict.fromkeys(archs, 0), []
    for path in objects:
        try:
            cubins = fatbin.images(path.read_bytes(), path.name, fatbin.ELF)
            for arch in archs:
                own = [k for image in cubins if image.arch == arch for k in fatbin.kernels(image.payload, path.name)]
                if not own:
                    problems.append(f"{path.name}: no kernel for sm_{arch} is in it")
                    continue
                sizes[arch] += sum(len(image.payload) for image in cubins if image.arch == arch)
                found.update({(name, arch): kernel for name, kernel in zip(readable([k.name for k in own]), own)})
        except (OSError, fatbin.FatbinError) as error:
            problems.append(str(error))
    return found, sizes, problems


def row_of(key, kernel):
    return [key[0], key[1], *(getattr(kernel, column) for column in HEADER[2:])]


def write_table(found, sizes, compiler):
    text = io.StringIO()
    text.write(f"# nvcc {compiler}; machine code of " +
               ", ".join(f"sm_{arch}: {size // 1024} KiB" for arch, size in sorted(sizes.items())) +
               "; written by tools/check_ptxas.py --update\n")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADER)
    table.writerows(row_of(key, found[key]) for key in sorted(found))
    return text.getvalue()


def read_table(text):
    """(compiler, {(kernel, arch): {column: number}})."""
    first, rest = text.split("\n", 1)
    compiler = re.match(r"# nvcc ([\d.]+);", first).group(1)
    return compiler, {(row["kernel"], row["arch"]): {column: int(row[column]) for column in HEADER[2:]}
                      for row in csv.DictReader(io.StringIO(rest))}


def compare(found, budget, archs):
    """Lists kernels that exceed their line, have none, or have a line and are not there."""
    problems = []
    for key in sorted(found):
        where = f"{key[0]} for sm_{key[1]}"
        allowed = budget.get(key)
        if allowed is None:
            problems.append(f"{where} has no line in the table: add it with --update")
            continue
        for column, share in ALLOWANCE.items():
            most = int(allowed[column] * (1 + share))
            needs = getattr(found[key], column)
            if needs > most:
                problems.append(f"{where} needs {needs} {column.replace('_', ' ')}, its line allows {allowed[column]}"
                                f"{f' and a tenth more' if share else ''}: find out why, or accept it with --update")
    for key in sorted(budget):
        if key[1] in archs and key not in found:
            problems.append(f"{key[0]} for sm_{key[1]} is in the table and not in the objects: take its line out with "
                            "--update if it is gone on purpose")
    return problems


def planted_cubin(registers, stack, code):
    """The least machine code that holds one kernel `k`."""
    strings = b"\0.symtab\0.strtab\0.nv.info\0.nv.info.k\0.text.k\0k\0"
    at = {name: strings.index(b"\0" + name.encode() + b"\0") + 1
          for name in (".symtab", ".strtab", ".nv.info", ".nv.info.k", ".text.k", "k")}
    info = struct.pack("<BBHII", 4, fatbin.REGCOUNT, 8, 1, registers)
    info += struct.pack("<BBHII", 4, fatbin.MIN_STACK_SIZE, 8, 1, stack)
    symbol = bytes(24) + struct.pack("<IBBHQQ", at["k"], 2, fatbin.KERNEL, 5, 0, len(code))
    parts = [(".strtab", strings), (".symtab", symbol), (".nv.info", info),
             (".nv.info.k", struct.pack("<BBH", 2, fatbin.NUM_BARRIERS, 1)), (".text.k", code)]
    body, headers = b"", bytes(64)
    for name, content in parts:
        headers += struct.pack("<IIQQQQIIQQ", at[name], 1, 0, 0, 64 + len(body), len(content), 1, 0, 1, 0)
        body += content
    head = b"\x7fELF" + bytes(14) + struct.pack("<H", fatbin.EM_CUDA) + bytes(20)
    head += struct.pack("<Q", 64 + len(body)) + bytes(10) + struct.pack("<HHH", 64, 6, 1)
    return head + body + headers


def planted_object(cubin, flags=0, whole=0):
    entry = struct.pack("<HHIQ", fatbin.ELF, 0x101, 64, len(cubin)) + struct.pack("<IIIII", len(cubin), 0, 0, 90, 0) + bytes(4)
    image = entry + struct.pack("<QQQ", flags, 0, whole) + cubin
    return b"object" + struct.pack("<IHHQ", fatbin.FATBIN_MAGIC, 1, 16, len(image)) + image


def zstd_frame(content):
    """Returns one block, stored as it is (RFC 8878, 3.1.1)."""
    return struct.pack("<IBI", 0xFD2FB528, 0xA0, len(content)) + (len(content) << 3 | 1).to_bytes(3, "little") + content


def self_test():
    """Objects with one thing wrong each, and tables that do not fit them."""
    failed = 0

    def expect(what, problems, wanted):
        nonlocal failed
        if (not problems) if wanted else problems:
            print(f"self-test: {what}: {problems}")
            failed += 1

    def kernels_of(registers, stack, code):
        data = planted_object(planted_cubin(registers, stack, code))
        image, = fatbin.images(data, "planted", fatbin.ELF)
        return {("k", image.arch): kernel for kernel in fatbin.kernels(image.payload, "planted")}

    plain, load, store, any_load, any_store, match = (
        struct.pack("<QQ", word, 0) for word in (0x7221, 0x7983, 0x7987, 0x7980, 0x7385, 0x73A1))
    code = 15 * plain + load + store + any_load + any_store + match
    found = kernels_of(40, 16, code)
    if row_of(("k", "90"), found[("k", "90")]) != ["k", "90", 40, 16, 1, 1, 1, 1, 1, 1, 20]:
        print(f"self-test: read {found}")
        failed += 1
    cubin = planted_cubin(40, 16, code)
    image, = fatbin.images(planted_object(zstd_frame(cubin), fatbin.ZSTD, len(cubin)), "planted", fatbin.ELF)
    expect("compressed", image.payload != cubin, False)
    text = write_table(found, {"90": 4096}, "13.0.88")
    compiler, budget = read_table(text)
    expect("the compiler's version", compiler != "13.0.88", False)
    expect("the same object", compare(found, budget, ["90"]), False)
    expect("a tenth more registers", compare(kernels_of(44, 16, code), budget, ["90"]), False)
    expect("more registers", compare(kernels_of(45, 16, code), budget, ["90"]), True)
    expect("more stack", compare(kernels_of(40, 24, code), budget, ["90"]), True)
    expect("two more instructions", compare(kernels_of(40, 16, code + 2 * plain), budget, ["90"]), False)
    expect("three more instructions", compare(kernels_of(40, 16, code + 3 * plain), budget, ["90"]), True)
    for what, more in [("a spill", load), ("another spill", store), ("a generic load", any_load),
                       ("a generic store", any_store), ("a match", match)]:
        expect(what, compare(kernels_of(40, 16, code[16:] + more), budget, ["90"]), True)
    expect("a kernel without a line", compare({**found, ("l", "90"): found[("k", "90")]}, budget, ["90"]), True)
    expect("a line without a kernel", compare({}, budget, ["90"]), True)
    expect("a line of an architecture that is not built", compare({}, budget, ["80"]), False)
    for what, data in [("compressed by another method", planted_object(cubin, fatbin.COMPRESSED & ~fatbin.ZSTD)),
                       ("damaged", planted_object(zstd_frame(cubin)[1:], fatbin.ZSTD, len(cubin))),
                       ("too long", planted_object(zstd_frame(cubin), fatbin.ZSTD, len(cubin) + 1)),
                       ("another layout", planted_object(bytes(200))),
                       ("no attributes", planted_object(planted_cubin(40, 16, code).replace(
                           struct.pack("<BBHI", 4, fatbin.REGCOUNT, 8, 1), struct.pack("<BBHI", 4, 1, 8, 1))))]:
        try:
            for image in fatbin.images(data, what, fatbin.ELF):
                fatbin.kernels(image.payload, what)
            print(f"self-test: {what} was not noticed")
            failed += 1
        except fatbin.FatbinError:
            pass
    names = ["_ZN8stiction8isa_cuda9run_teamsINS0_16SortEnvironmentsEEEvNT_4ArgsENS_4cuda9CudaShapeE",
             "_ZN8stiction8isa_cuda9run_teamsINS0_10SolveTeamsINS0_3PgsELNS_3LawE1ELNS_7EnvPathE2EfEEEEvNT_4ArgsENS_4cuda9"
             "CudaShapeE",
             "_ZN8stiction4cuda45_GLOBAL__N__9402b11f_12_cuda_plan_cu_c9eaa7315probeEv"]
    expect("names", readable(names) != ["SortEnvironments", "SolveTeams<Pgs, coulomb, sparse, float>", "probe"], False)
    print(f"self-test: {failed} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--self-test", action="store_true", help="check that planted excesses are found")
    parser.add_argument("--update", action="store_true", help="write the table from the objects")
    parser.add_argument("--budget", type=pathlib.Path, help="the table")
    parser.add_argument("--compiler", help="version of the nvcc that made the objects")
    parser.add_argument("--arch", action="append", help="compute capability that every object holds, as 90")
    parser.add_argument("objects", nargs="*", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if not (arguments.objects and arguments.arch and arguments.budget and arguments.compiler):
        parser.error("--budget, --compiler, --arch and objects are needed")
    found, sizes, problems = read_objects(arguments.objects, arguments.arch)
    if arguments.update and not problems:
        arguments.budget.write_text(write_table(found, sizes, arguments.compiler))
        print(f"{arguments.budget}: {len(found)} kernels")
        return 0
    if not arguments.budget.is_file():
        print(f"SKIPPED: there is no {arguments.budget} yet: write it with --update")
        return 77
    if not problems:
        compiler, budget = read_table(arguments.budget.read_text())
        if compiler != arguments.compiler:
            print(f"SKIPPED: the table is of nvcc {compiler}, this is {arguments.compiler}, which makes other code")
            return 77
        unknown = [arch for arch in arguments.arch if not any(key[1] == arch for key in budget)]
        if unknown:
            print(f"SKIPPED: the table has no lines for sm_{', sm_'.join(unknown)}")
            return 77
        problems = compare(found, budget, arguments.arch)
    for problem in problems:
        print(problem)
    print(f"{len(arguments.objects)} objects, {len(found)} kernels, {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
