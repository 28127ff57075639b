#!/usr/bin/env python3
"""Translates PTX, as nvcc writes it for the kernels, to C++ that runs on the CPU (tests/ptx/).

    tools/ptx_to_cpp.py OBJECT --arch 80 -o FILE.cpp      the PTX inside an object of a build with tests
    tools/ptx_to_cpp.py FILE.ptx -o FILE.cpp
    tools/ptx_to_cpp.py FILE.ptx --trace -o FILE.cpp      its lanes leave traces (tests/ptx/replay.hpp)
    tools/ptx_to_cpp.py --self-test

A function becomes a function of the lane that runs it, a register a variable, an instruction a statement. An
instruction that is not known here is an error, and so is arithmetic on floats without a rounding mode.
"""

import argparse
import collections
import pathlib
import re
import sys

import fatbin
from ptx_function import Function
from ptx_text import PtxError, cpp, identifier, parameters, statements
from ptx_trace import TracedFunction, in_order


class Module:
    """The functions and kernels of one PTX text."""

    HEAD = re.compile(r"(?:\.visible |\.weak )?\.(func|entry)\s*(?:\(([^)]*)\))?\s*([\w$]+)\s*\(([^)]*)\)\s*(\.\w+[^;{]*)?([;{])")
    MOST_THREADS = re.compile(r"\.maxntid\s+(\d+)\s*(?:,\s*1\s*)*(?:\.|$)")

    def __init__(self, text, traces=False):
        self.traced = [] if traces else None  # (PTX name, pieces) of each function
        text = re.sub(r"//[^\n]*", "", text)
        self.text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        self.seen = collections.Counter()
        self.functions = {}  # PTX name -> C++ name
        self.prototypes, self.bodies, self.globals, self.kernels = [], [], [], []
        self.symbols = {match: "lane.shared_symbol()" for match in re.findall(r"\.extern \.shared [^;]*?([\w$]+)\[\]\s*;", self.text)}
        self.find_globals()
        self.find_functions()

    def find_globals(self):
        for match in re.finditer(r"^(?:\.visible |\.weak )?\.(?:global|const) \.align (\d+) \.(\w+) ([\w$]+)(?:\[(\d+)\])?"
                                 r"\s*(?:=\s*\{?([^;{}]*)\}?)?\s*;", self.text, re.MULTILINE):
            name = "global_" + identifier(match[3])
            self.symbols[match[3]] = name
            self.globals.append(f"alignas({match[1]}) {cpp(match[2])} {name}[{match[4] or 1}] = {{{match[5] or ''}}};")

    def find_functions(self):
        at, found = 0, []
        while match := self.HEAD.search(self.text, at):
            kind, result, name, given, directives, end = match.groups()
            at = match.end()
            given, result = parameters(given), parameters(result or "")
            if name not in self.functions:
                self.functions[name] = "run_" + identifier(name)
                arguments = ["Lane& lane", "unsigned char* result"] + [f"unsigned char* given{i}" for i in range(len(given))]
                self.prototypes.append(f"void {self.functions[name]}({', '.join(arguments)})")
            if end == ";":
                continue
            depth, first = 1, at
            while depth:
                depth += {"{": 1, "}": -1}.get(self.text[at], 0)
                at += 1
            found.append((name, given, result, self.text[first:at - 1]))
            if kind == "entry":
                most = self.MOST_THREADS.search((directives or "").strip())
                if ".maxntid" in (directives or "") and not most:
                    raise PtxError(f"{name}: expected .maxntid of one dimension, got {directives.strip()}")
                self.kernels.append((name, given, int(most[1]) if most else 1024))
        prototypes = dict(zip(self.functions, self.prototypes))
        for name, given, result, body in found:
            self.bodies.append(self.translate(name, prototypes[name], given, result, body))

    def translate(self, name, prototype, given, result, body):
        symbols = dict(self.symbols)
        symbols.update({name: f"given{i}" for i, (name, _) in enumerate(given)})
        symbols.update({name: "result" for name, _ in result})
        function = Function(self, symbols) if self.traced is None else TracedFunction(self, symbols)
        for statement in statements(body):
            function.add(statement)
        function.count()
        if self.traced is not None:
            self.traced.append((name, function.pieces()))
        lines = [prototype + " {"]
        if function.depot:
            name, alignment, size = function.depot
            lines.append(f"alignas({alignment}) unsigned char {name}[{size}]; poison({name}, {size});")
        by_type = collections.defaultdict(list)
        for register, kind in function.types.items():
            by_type[cpp(kind)].append(register)
        for kind, registers in by_type.items():
            lines += [f"{kind} {', '.join(registers[i:i + 12])};" for i in range(0, len(registers), 12)]
        return "\n".join(lines + function.code + ["}"])

    def piece_count(self):
        """Pieces of the functions so far. Numbers of pieces begin at 1."""
        return sum(len(pieces) for _, pieces in self.traced)

    def traced_text(self):
        """Facts about the code for a replay."""
        pieces, sites = [], []
        for i, (_, own) in enumerate(self.traced):
            for instructions, position, accesses in own:
                pieces.append(f"{{{instructions}, {i}, {position}, {len(sites)}}}")
                sites += map(str, accesses)
        names = ", ".join(f'"{name}"' for name, _ in self.traced)
        return [f"const char* const functions[] = {{{names}}};",
                f"const TracedPiece pieces[] = {{{{}}, {', '.join(pieces)}}};",
                f"const u32 access_bytes[] = {{{', '.join(sites + ['0'])}}};",
                "const TracedCode code{functions, pieces, access_bytes};"]

    def without_templates(self):
        """Names for the templates that are called most: lines, and the functions, which call these. To find the arguments
        of a template GCC puts aside every name of the function that calls it, and a kernel has thousands."""
        wanted = re.compile(r"\b(load|store|fused|bits_as|shift_left|shift_right|larger|smaller)<(\w+)>\(")
        found = sorted({match for body in self.bodies for match in wanted.findall(body)})
        other = {"double": "u64", "float": "u32", "u64": "double", "u32": "float"}
        names = [f"constexpr auto& {name}_{kind} = {name}<{kind}{', ' + other[kind] if name == 'bits_as' else ''}>;"
                 for name, kind in found]
        return names, [wanted.sub(r"\1_\2(", body) for body in self.bodies]

    def cpp_text(self):
        names, bodies = self.without_templates()
        lines = ["// Made by tools/ptx_to_cpp.py.", '#include "tests/ptx/operations.hpp"', "",
                 "namespace stiction::ptx {", "namespace {", ""]
        if self.traced is not None:
            lines.insert(2, '#include "tests/ptx/trace.hpp"')
        lines += names + self.globals + [prototype + ";" for prototype in self.prototypes] + bodies
        if self.traced is not None:
            lines += self.traced_text()
        for i, (name, given, most) in enumerate(self.kernels):
            passed = "".join(f", parameter[{k}]" for k in range(len(given)))
            lines.append(f"void enter_{i}(Lane& lane, unsigned char** parameter) {{ {self.functions[name]}(lane, nullptr{passed}); }}")
            if self.traced is not None:
                lines.append(f'const RegisteredTrace registered_{i}({{"{name}", enter_{i}, &code}});')
                continue
            lines.append(f"void launch_{i}(const cuda::EmulatedLaunch&, const void*);")
            sizes = ", ".join(str(size) for _, size in given)
            lines.append(f'Kernel kernel_{i}{{"{name}", enter_{i}, {{launch_{i}}}, {{{sizes}}}, {most}}};')
            lines.append(f"void launch_{i}(const cuda::EmulatedLaunch& shape, const void* arguments) {{ launch(kernel_{i}, shape, arguments); }}")
            lines.append(f"const Registered registered_{i}(kernel_{i});")
        return "\n".join(lines + ["", "}  // namespace", "}  // namespace stiction::ptx", ""])


def text_of(path, arch):
    data = path.read_bytes()
    if path.suffix == ".ptx":
        return data.decode()
    found = [image for image in fatbin.images(data, path.name, fatbin.PTX) if image.arch == arch]
    if len(found) != 1:
        raise PtxError(f"{path.name} has {len(found)} texts of PTX for sm_{arch}, expected one")
    return fatbin.ptx_text(found[0])


def self_test():
    def body(code):
        registers = ".reg .pred %p<3>; .reg .b32 %r<5>; .reg .f32 %f<4>; .reg .b64 %rd<4>;"
        return f".visible .entry k(.param .u64 k_param_0)\n{{ {registers} {code} }}"

    wrong = ["ex2.approx.f32 %f1, %f2;", "add.f32 %f1, %f2, %f3;", "fma.rz.f32 %f1, %f2, %f3, %f1;", "add.rn.ftz.f32 %f1, %f2, %f3;",
             "cvt.rni.s32.f32 %r1, %f1;", "bar.sync 1;", "shfl.sync.down.b32 %r1|%p1, %r2, 1, 31, -1;", "vote.sync.all.pred %p1, %p2, -1;",
             "mov.u32 %r1, %clock;", "add.s32 %r1, %r9, 1;", "atom.global.cas.b32 %r1, [%rd1], %r2, %r3;",
             "shf.r.clamp.b32 %r1, %r2, %r3, %r4;"]
    right = {"add.rn.f32 %f1, %f2, 0f3F800000;": "f1 = (f2 + bits_as_float(0x3F800000U));",
             "@!%p1 bra $L_1; $L_1: ret;": "if (!p1) { goto _L_1; }",
             "setp.ne.f32 %p1, %f1, %f2;": "p1 = (f1 < f2 || f1 > f2);",
             "ld.shared.u32 %r1, [%rd1+-8];": "r1 = load_u32(lane.shared_address((rd1 + u64(-8LL))));",
             "shf.l.wrap.b32 %r1, %r2, %r3, %r4;": "r1 = u32(((u64(r3) << 32U) | r2) << (r4 & 31U) >> 32U);",
             "mul.wide.s32 %rd1, %r1, 8;": "rd1 = u64(i64(i64(i32(r1)) * i64(i32(8ULL))));"}
    failed = 0
    for code in wrong:
        try:
            Module(body(code))
        except PtxError:
            continue
        failed += 1
        print(f"not refused: {code}")
    for code, expected in right.items():
        if expected not in Module(body(code)).cpp_text():
            failed += 1
            print(f"{code} is not {expected}")
    # Loops within loops, an exit that is written before its loop, two ways around.
    orders = {((1,), (2, 5), (3, 4), (2, 4), (1,), ()): [0, 1, 2, 3, 4, 5],
              ((2,), (), (1, 3), (4, 2), (2,)): [0, 2, 3, 4, 1],
              ((1,), (2, 3), (), (4,), (5,), (1,)): [0, 1, 3, 4, 5, 2]}
    for leads, expected in orders.items():
        if in_order(range(len(leads)), leads) != expected:
            failed += 1
            print(f"{leads} are in the order {in_order(range(len(leads)), leads)}, not {expected}")
    print(f"{len(wrong) + len(right) + len(orders)} cases, {failed} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="?", type=pathlib.Path)
    parser.add_argument("--arch", default="80")
    parser.add_argument("-o", "--output", type=pathlib.Path)
    parser.add_argument("--trace", action="store_true", help="let lanes leave traces")
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if arguments.file is None or arguments.output is None:
        parser.error("a file and -o are needed")
    try:
        module = Module(text_of(arguments.file, arguments.arch), arguments.trace)
    except (PtxError, fatbin.FatbinError) as error:
        print(f"{arguments.file.name}: {error}", file=sys.stderr)
        return 1
    arguments.output.write_text(module.cpp_text(), encoding="utf-8")
    print(f"{arguments.file.name}: {len(module.kernels)} kernels, {sum(module.seen.values())} instructions of {len(module.seen)} forms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
