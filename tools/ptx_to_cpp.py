#!/usr/bin/env python3
"""Translates PTX, as nvcc writes it for the kernels, to C++ that runs on the CPU (tests/ptx/).

    tools/ptx_to_cpp.py OBJECT --arch 80 -o FILE.cpp      the PTX inside an object of a build with tests
    tools/ptx_to_cpp.py FILE.ptx -o FILE.cpp
    tools/ptx_to_cpp.py --self-test

Every function becomes a function of the lane that runs it, every register a variable, every instruction a statement
(tests/ptx/operations.hpp says what each does, after NVIDIA's "PTX ISA", version 9.0). An instruction that is not known
here is an error, and so is arithmetic on floats without a rounding mode: nothing is guessed.
"""

import argparse
import collections
import pathlib
import re
import sys

import fatbin

BYTES = {"pred": 1, "b8": 1, "u8": 1, "s8": 1, "b16": 2, "u16": 2, "s16": 2, "b32": 4, "u32": 4, "s32": 4, "f32": 4,
         "b64": 8, "u64": 8, "s64": 8, "f64": 8}
FLOATS = ("f32", "f64")
#: Values of registers that are no variables. Blocks and grids have one dimension.
SPECIAL = {"%tid.x": "lane.thread", "%ntid.x": "lane.block_size", "%ctaid.x": "lane.block", "%nctaid.x": "lane.blocks",
           "%laneid": "(lane.thread % 32)", "%tid.y": "0", "%tid.z": "0", "%ctaid.y": "0", "%ctaid.z": "0",
           "%ntid.y": "1", "%ntid.z": "1", "%nctaid.y": "1", "%nctaid.z": "1",
           "%envreg1": "lane.grid_word(1)", "%envreg2": "lane.grid_word(0)"}
COMPARISONS = {"eq": "==", "lt": "<", "le": "<=", "gt": ">", "ge": ">=", "lo": "<", "ls": "<=", "hi": ">", "hs": ">="}
UNORDERED = {"equ": "==", "neu": "!=", "ltu": "<", "leu": "<=", "gtu": ">", "geu": ">="}
ATOMICS = ("add", "or", "and", "max", "min", "exch")


class PtxError(Exception):
    """What cannot be translated, in a sentence."""


def cpp(kind):
    """C++ type of a PTX type."""
    if kind == "pred":
        return "bool"
    if kind in FLOATS:
        return {"f32": "float", "f64": "double"}[kind]
    return ("i" if kind[0] == "s" else "u") + kind[1:]


def identifier(name):
    return re.sub(r"\W", "_", name)


def split(text):
    """Operands, which commas separate outside of braces and brackets."""
    parts, depth, own = [], 0, ""
    for character in text:
        depth += {"{": 1, "[": 1, "(": 1, "}": -1, "]": -1, ")": -1}.get(character, 0)
        if character == "," and depth == 0:
            parts.append(own.strip())
            own = ""
        else:
            own += character
    return parts + [own.strip()] if own.strip() else parts


def parameters(text):
    """(name, bytes) of a parameter list."""
    found = []
    for one in split(text):
        match = re.fullmatch(r"\.param\s+(?:\.align\s+\d+\s+)?\.(\w+)\s+([\w$]+)(?:\[(\d+)\])?", one)
        if match is None:
            raise PtxError(f"a parameter of unknown form: {one}")
        found.append((match[2], int(match[3] or 1) * BYTES[match[1]]))
    return found


def statements(body):
    """Statements, braces and labels of a function's body."""
    own, vector = "", 0
    for character in body:
        if character in "{}" and (vector or (character == "{" and own.strip())):
            vector += 1 if character == "{" else -1
            own += character
        elif character in "{}":
            yield character
            own = ""
        elif character == ";":
            if own.strip():
                yield " ".join(own.split())
            own = ""
        elif character == ":" and re.fullmatch(r"\s*[$\w]+", own):
            yield own.strip() + ":"
            own = ""
        else:
            own += character


class Function:
    """One function, being translated."""

    def __init__(self, module, symbols):
        self.module = module
        self.symbols = dict(symbols)  # name -> C++ expression of its address
        self.types = {}  # register -> PTX type
        self.depot = None  # (C++ name, alignment, bytes) of memory on the stack
        self.code = []
        self.counted = [0, 0, 0]  # instructions, generic and stack accesses since the last place where control can enter or leave

    # -- operands

    def read(self, operand, kind):
        """Value of an operand as a PTX type."""
        if operand in SPECIAL:
            return f"{cpp(kind)}({SPECIAL[operand]})"
        if operand.startswith("%"):
            return self.cast(identifier(operand[1:]), self.type_of(operand), kind)
        number = re.fullmatch(r"0[fF]([0-9a-fA-F]{8})|0[dD]([0-9a-fA-F]{16})", operand)
        if number:
            bits, own = (f"0x{number[1]}U", "f32") if number[1] else (f"0x{number[2]}ULL", "f64")
            return self.cast(f"bits_as<{cpp(own)}>({bits})", own, kind)
        if re.fullmatch(r"-?(0x[0-9a-fA-F]+|\d+)U?", operand):
            if kind in FLOATS:
                raise PtxError(f"an integer where {kind} is read: {operand}")
            if kind == "pred":
                return "true" if int(operand.rstrip("U"), 0) else "false"
            value = int(operand.rstrip("U"), 0) % (1 << 8 * BYTES[kind])
            return f"{cpp(kind)}({value}ULL)"
        if operand in self.symbols:
            return f"u64({self.symbols[operand]})"
        raise PtxError(f"an operand of unknown form: {operand}")

    def type_of(self, register):
        name = identifier(register[1:])
        if name not in self.types:
            raise PtxError(f"a register that is not declared: {register}")
        return self.types[name]

    @staticmethod
    def cast(value, own, kind):
        if own == kind or cpp(own) == cpp(kind):
            return value
        if (own in FLOATS) != (kind in FLOATS):
            return f"bits_as<{cpp(kind)}>({value})"
        return f"{cpp(kind)}({value})"

    def write(self, register, value, kind):
        """Statement that gives a register a value of a PTX type; a wider register is filled up by the type's sign."""
        own = self.type_of(register)
        return f"{identifier(register[1:])} = {self.cast(value, kind, own)};"

    def address(self, operand):
        match = re.fullmatch(r"\[\s*([%\w$.]+?)\s*(?:\+\s*(-?\d+))?\s*\]", operand)
        if match is None:
            raise PtxError(f"an address of unknown form: {operand}")
        base = self.read(match[1], "u64")
        return f"({base} + u64({int(match[2])}LL))" if match[2] and int(match[2]) else base

    # -- statements

    def count(self):
        """Adds what was counted to the lane's counters."""
        if any(self.counted):
            self.code.append(f"lane.count({', '.join(map(str, self.counted))});")
        self.counted = [0, 0, 0]

    def add(self, statement):
        if statement in "{}":
            self.code.append(statement)
        elif statement.endswith(":"):
            self.count()
            self.code.append(f"{identifier(statement[:-1])}:;")
        elif statement.startswith(".reg"):
            self.declare(statement)
        elif statement.startswith(".local"):
            match = re.fullmatch(r"\.local \.align (\d+) \.b8 (\w+)\[(\d+)\]", statement)
            self.depot = identifier(match[2]), int(match[1]), int(match[3])
            self.symbols[match[2]] = self.depot[0]
        elif statement.startswith(".param"):
            ((name, size),) = parameters(statement)
            self.symbols[name] = identifier(name)
            self.code.append(f"alignas(16) unsigned char {identifier(name)}[{max(size, 8)}];")
        elif statement.startswith(".pragma"):
            pass
        elif statement.startswith("call"):
            self.call(statement)
        else:
            self.instruction(statement)

    def declare(self, statement):
        match = re.fullmatch(r"\.reg \.(\w+) (.*)", statement)
        for one in match[2].split(","):
            many = re.fullmatch(r"%?(\w+)<(\d+)>", one.strip())
            names = [f"{many[1]}{k}" for k in range(int(many[2]))] if many else [identifier(one.strip().lstrip("%"))]
            self.types.update(dict.fromkeys(names, match[1]))

    def call(self, statement):
        match = re.fullmatch(r"call(?:\.uni)? (?:\( ?(\w+) ?\) ?, ?)?([\w$]+) ?(?:, ?\(([^)]*)\))?", statement)
        if match is None or match[2] not in self.module.functions:
            raise PtxError(f"a call of unknown form: {statement}")
        self.counted[0] += 1
        self.count()
        given = [self.symbols[name] for name in split(match[3] or "")]
        self.code.append(f"{self.module.functions[match[2]]}({', '.join(['lane', match[1] or 'nullptr'] + given)});")

    def instruction(self, statement):
        match = re.fullmatch(r"(?:@(!?)%(\w+) )?([a-z][\w.:]*)(?: (.*))?", statement)
        if match is None:
            raise PtxError(f"an instruction of unknown form: {statement}")
        parts = match[3].split(".")
        self.module.seen[match[3]] += 1
        self.counted[0] += 1
        translate = getattr(self, f"op_{parts[0]}", None)
        if translate is None:
            raise PtxError(f"an unknown instruction: {statement}")
        try:
            text = translate(parts[1:], split(match[4] or ""))
        except (KeyError, IndexError, ValueError) as error:
            raise PtxError(f"an unknown form of an instruction: {statement} ({error})") from error
        if text is None:
            raise PtxError(f"an unknown form of an instruction: {statement}")
        if parts[0] in ("bra", "ret", "exit"):
            self.count()
        guard = f"if ({match[1]}{identifier(match[2])}) " if match[2] else ""
        self.code.append(f"{guard}{{ {text} }}" if guard else text)

    # -- instructions: (modifiers, operands) -> C++

    def op_bra(self, _, o):
        return f"goto {identifier(o[0])};"

    def op_ret(self, *_):
        return "return;"

    def op_exit(self, *_):
        return "lane.leave();"

    def op_trap(self, *_):
        return "lane.trap();"

    def op_mov(self, m, o):
        kind = m[-1]
        if o[0].startswith("{"):
            parts = split(o[0][1:-1])
            bits = 8 * BYTES[kind] // len(parts)
            taken = [self.write(part, f"u{bits}(whole >> {bits * i})", f"u{bits}") for i, part in enumerate(parts) if part != "_"]
            return f"{{ const u64 whole = {self.read(o[1], 'b' + kind[1:])}; {' '.join(taken)} }}"
        if o[1].startswith("{"):
            parts = split(o[1][1:-1])
            bits = 8 * BYTES[kind] // len(parts)
            joined = " | ".join(f"u64({self.read(part, f'b{bits}')}) << {bits * i}" for i, part in enumerate(parts))
            return self.write(o[0], f"{cpp('b' + kind[1:])}({joined})", "b" + kind[1:])
        return self.write(o[0], self.read(o[1], kind), kind)

    def space(self, m):
        """State space of a memory instruction; counts the access."""
        space = next((part for part in m if part in ("param", "local", "shared", "global", "const")), "generic")
        self.counted[1] += space in ("generic", "global")
        self.counted[2] += space == "local"
        return space

    def place(self, space, operand):
        address = self.address(operand)
        return f"lane.shared_address({address})" if space == "shared" else address

    def op_ld(self, m, o):
        kind, place = m[-1], self.place(self.space(m), o[1])
        known = {"param", "local", "shared", "global", "const", "v2", "v4", "nc", "acquire", "gpu", "volatile", "relaxed", kind}
        if set(m) - known:
            return None
        wait = "lane.spin(); " if "acquire" in m or "volatile" in m else ""
        if o[0].startswith("{"):
            parts = split(o[0][1:-1])
            taken = [self.write(part, f"load<{cpp(kind)}>(from + {i * BYTES[kind]})", kind) for i, part in enumerate(parts) if part != "_"]
            return f"{{ {wait}const u64 from = aligned({place}, {len(parts) * BYTES[kind]}); {' '.join(taken)} }}"
        text = self.write(o[0], f"load<{cpp(kind)}>({place})", kind)
        return f"{{ {wait}{text} }}" if wait else text

    def op_st(self, m, o):
        kind, place = m[-1], self.place(self.space(m), o[0])
        if set(m) - {"param", "local", "shared", "global", "v2", "v4", "release", "gpu", "volatile", "relaxed", kind}:
            return None
        if o[1].startswith("{"):
            parts = split(o[1][1:-1])
            stored = [f"store<{cpp(kind)}>(to + {i * BYTES[kind]}, {self.read(part, kind)});" for i, part in enumerate(parts)]
            return f"{{ const u64 to = aligned({place}, {len(parts) * BYTES[kind]}); {' '.join(stored)} }}"
        return f"store<{cpp(kind)}>({place}, {self.read(o[1], kind)});"

    def op_atom(self, m, o):
        kind = m[-1]
        (operation,) = [part for part in m if part in ATOMICS]
        if set(m) - {"global", "shared", "relaxed", "release", "acquire", "acq_rel", "gpu", "cta", operation, kind}:
            return None
        place = self.place(self.space(m), o[1])
        return self.write(o[0], f"atomic_{operation}<{cpp(kind)}>({place}, {self.read(o[2], kind)})", kind)

    def op_setp(self, m, o):
        if len(m) != 2:
            return None
        compare, kind = m
        x, y = self.read(o[1], kind), self.read(o[2], kind)
        if compare in ("num", "nan"):
            return self.write(o[0], f"{'' if compare == 'num' else '!'}is_ordered({x}, {y})", "pred")
        if compare == "ne":
            value = f"({x} < {y} || {x} > {y})" if kind in FLOATS else f"{x} != {y}"
        elif compare in UNORDERED:
            value = f"(!is_ordered({x}, {y}) || {x} {UNORDERED[compare]} {y})"
        else:
            value = f"{x} {COMPARISONS[compare]} {y}"
        return self.write(o[0], value, "pred")

    def op_selp(self, m, o):
        kind = m[-1]
        return self.write(o[0], f"({self.read(o[3], 'pred')} ? {self.read(o[1], kind)} : {self.read(o[2], kind)})", kind)

    def logic(self, symbol, m, o):
        kind = m[-1]
        return self.write(o[0], f"{cpp(kind)}({self.read(o[1], kind)} {symbol} {self.read(o[2], kind)})", kind)

    def op_and(self, m, o):
        return self.logic("&", m, o)

    def op_or(self, m, o):
        return self.logic("|", m, o)

    def op_xor(self, m, o):
        return self.logic("^", m, o)

    def op_not(self, m, o):
        kind = m[-1]
        return self.write(o[0], f"{'!' if kind == 'pred' else cpp(kind) + '(~'}{self.read(o[1], kind)}{'' if kind == 'pred' else ')'}", kind)

    def named(self, name, m, o, counts=()):
        """name<type>(operands); those at `counts` are unsigned numbers of bits."""
        kind = m[-1]
        given = [self.read(one, "u32" if i in counts else kind) for i, one in enumerate(o[1:])]
        return self.write(o[0], f"{name}<{cpp(kind)}>({', '.join(given)})", kind)

    def op_shl(self, m, o):
        return self.named("shift_left", m, o, (1,))

    def op_shr(self, m, o):
        return self.named("shift_right", m, o, (1,))

    def op_bfi(self, m, o):
        return self.named("insert_bits", m, o, (2, 3))

    def op_bfe(self, m, o):
        return self.named("extract_bits", m, o, (1, 2))

    def op_prmt(self, m, o):
        return self.named("permute_bytes", m, o)

    def op_popc(self, m, o):
        return self.write(o[0], f"u32(__builtin_popcountll({self.read(o[1], m[-1])}))", "u32")

    def op_clz(self, m, o):
        return self.write(o[0], f"leading_zeros<{cpp(m[-1])}>({self.read(o[1], m[-1])})", "u32")

    def op_brev(self, m, o):
        return self.named("reverse_bits", m, o)

    def arithmetic(self, symbol, m, o):
        """Sum, difference or product: of floats rounded to nearest, of integers modulo their size."""
        kind = m[-1]
        if kind in FLOATS:
            if m != ["rn", kind]:
                return None
            return self.write(o[0], f"({self.read(o[1], kind)} {symbol} {self.read(o[2], kind)})", kind)
        if m not in ([kind], ["lo", kind]):
            return None
        unsigned = "u" + kind[1:]
        wide = "u32" if BYTES[kind] < 4 else cpp(unsigned)
        return self.write(o[0], f"{cpp(unsigned)}({wide}({self.read(o[1], unsigned)}) {symbol} {wide}({self.read(o[2], unsigned)}))", unsigned)

    def op_add(self, m, o):
        return self.arithmetic("+", m, o)

    def op_sub(self, m, o):
        return self.arithmetic("-", m, o)

    def wide_product(self, kind, o):
        wide = f"{kind[0]}{16 * BYTES[kind]}"
        return f"{cpp(wide)}({cpp(wide)}({self.read(o[1], kind)}) * {cpp(wide)}({self.read(o[2], kind)}))", wide

    def op_mul(self, m, o):
        kind = m[-1]
        if m == ["wide", kind]:
            return self.write(o[0], *self.wide_product(kind, o))
        if m == ["hi", kind]:
            return self.named("high_product", m, o)
        return self.arithmetic("*", m, o)

    def op_mad(self, m, o):
        kind = m[-1]
        if m == ["wide", kind]:
            product, wide = self.wide_product(kind, o)
            unsigned = "u" + wide[1:]
            return self.write(o[0], f"{cpp(unsigned)}({cpp(unsigned)}({product}) + {self.read(o[3], unsigned)})", unsigned)
        if m != ["lo", kind]:
            return None
        u = "u" + kind[1:]
        return self.write(o[0], f"{cpp(u)}({self.read(o[1], u)} * {self.read(o[2], u)} + {self.read(o[3], u)})", u)

    def op_fma(self, m, o):
        return self.named("fused", m, o) if m == ["rn", m[-1]] else None

    def op_div(self, m, o):
        if m[-1] in FLOATS:
            return self.arithmetic("/", m, o)
        return self.named("quotient", m, o) if len(m) == 1 else None

    def op_rem(self, m, o):
        return self.named("remainder", m, o)

    def op_sqrt(self, m, o):
        return self.named("square_root", m, o) if m == ["rn", m[-1]] else None

    def op_rcp(self, m, o):
        kind = m[-1]
        return self.write(o[0], f"({cpp(kind)}(1) / {self.read(o[1], kind)})", kind) if m == ["rn", kind] else None

    def op_neg(self, m, o):
        return self.named("negative", m, o) if len(m) == 1 else None

    def op_abs(self, m, o):
        return self.named("magnitude", m, o) if len(m) == 1 else None

    def op_min(self, m, o):
        return self.named("smaller", m, o) if len(m) == 1 else None

    def op_max(self, m, o):
        return self.named("larger", m, o) if len(m) == 1 else None

    def op_cvt(self, m, o):
        to, of = m[-2:]
        modes, value = set(m[:-2]), self.read(o[1], of)
        if to in FLOATS and of in FLOATS:
            allowed = {"rn"} if BYTES[to] < BYTES[of] else set()
            if modes != allowed:
                return None
        elif to in FLOATS:
            if modes != {"rn"}:
                return None
        elif of in FLOATS:
            if modes != {"rzi"}:
                return None
            value = f"truncated<{cpp(to)}>({value})"
        elif modes:
            return None
        return self.write(o[0], f"{cpp(to)}({value})", to)

    def op_cvta(self, m, o):
        value = self.read(o[1], "u64")
        if "shared" in m:
            value = f"lane.shared_offset({value})" if "to" in m else f"lane.shared_address({value})"
        return self.write(o[0], value, "u64")

    def op_bar(self, m, o):
        if m == ["warp", "sync"]:
            return f"lane.meet_warp({self.read(o[0], 'u32')});"
        return "lane.meet_block();" if m == ["sync"] and o == ["0"] else None

    def op_barrier(self, m, o):
        return "lane.meet_block();" if m == ["sync"] and o == ["0"] else None

    def op_shfl(self, m, o):
        if m[0] != "sync" or m[1] not in ("bfly", "idx"):
            return None
        to = o[0].split("|")
        given = [self.read(one, "u32") for one in o[1:]]
        text = self.write(to[0], f"lane.shuffle_{m[1]}({', '.join(given)})", "b32")
        return text + (" " + self.write(to[1], "true", "pred") if len(to) > 1 else "")

    def op_redux(self, m, o):
        if m[0] != "sync" or m[1] not in ("or", "add"):
            return None
        return self.write(o[0], f"lane.reduce_{m[1]}({self.read(o[1], 'u32')}, {self.read(o[2], 'u32')})", "u32")

    def op_membar(self, *_):
        return ";"

    def op_fence(self, *_):
        return ";"


class Module:
    """The functions and kernels of one PTX text."""

    HEAD = re.compile(r"(?:\.visible |\.weak )?\.(func|entry)\s*(?:\(([^)]*)\))?\s*([\w$]+)\s*\(([^)]*)\)\s*(?:\.\w+[^;{]*)?([;{])")

    def __init__(self, text):
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
            kind, result, name, given, end = match.groups()
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
                self.kernels.append((name, given))
        prototypes = dict(zip(self.functions, self.prototypes))
        for name, given, result, body in found:
            self.bodies.append(self.translate(prototypes[name], given, result, body))

    def translate(self, prototype, given, result, body):
        symbols = dict(self.symbols)
        symbols.update({name: f"given{i}" for i, (name, _) in enumerate(given)})
        symbols.update({name: "result" for name, _ in result})
        function = Function(self, symbols)
        for statement in statements(body):
            function.add(statement)
        function.count()
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

    def cpp_text(self):
        lines = ["// Made by tools/ptx_to_cpp.py.", '#include "tests/ptx/operations.hpp"', "",
                 "namespace stiction::ptx {", "namespace {", ""]
        lines += self.globals + [prototype + ";" for prototype in self.prototypes] + self.bodies
        for i, (name, given) in enumerate(self.kernels):
            passed = "".join(f", parameter[{k}]" for k in range(len(given)))
            lines.append(f"void enter_{i}(Lane& lane, unsigned char** parameter) {{ {self.functions[name]}(lane, nullptr{passed}); }}")
            lines.append(f"void launch_{i}(const cuda::EmulatedLaunch&, const void*);")
            sizes = ", ".join(str(size) for _, size in given)
            lines.append(f'Kernel kernel_{i}{{"{name}", enter_{i}, {{launch_{i}}}, {{{sizes}}}}};')
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
             "mov.u32 %r1, %clock;", "add.s32 %r1, %r9, 1;", "atom.global.cas.b32 %r1, [%rd1], %r2, %r3;"]
    right = {"add.rn.f32 %f1, %f2, 0f3F800000;": "f1 = (f2 + bits_as<float>(0x3F800000U));",
             "@!%p1 bra $L_1; $L_1: ret;": "if (!p1) { goto _L_1; }",
             "setp.ne.f32 %p1, %f1, %f2;": "p1 = (f1 < f2 || f1 > f2);",
             "ld.shared.u32 %r1, [%rd1+-8];": "r1 = load<u32>(lane.shared_address((rd1 + u64(-8LL))));",
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
    print(f"{len(wrong) + len(right)} cases, {failed} failed")
    return 1 if failed else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="?", type=pathlib.Path)
    parser.add_argument("--arch", default="80")
    parser.add_argument("-o", "--output", type=pathlib.Path)
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if arguments.file is None or arguments.output is None:
        parser.error("a file and -o are needed")
    try:
        module = Module(text_of(arguments.file, arguments.arch))
    except (PtxError, fatbin.FatbinError) as error:
        print(f"{arguments.file.name}: {error}", file=sys.stderr)
        return 1
    arguments.output.write_text(module.cpp_text(), encoding="utf-8")
    print(f"{arguments.file.name}: {len(module.kernels)} kernels, {sum(module.seen.values())} instructions of {len(module.seen)} forms")
    return 0


if __name__ == "__main__":
    sys.exit(main())
