"""Instructions of PTX as statements of C++ (NVIDIA, "PTX ISA", version 9.0, section 9). Each is described in
tests/ptx/operations.hpp.
"""

from ptx_text import ATOMICS, BYTES, COMPARISONS, FLOATS, UNORDERED, cpp, identifier, split


class Instructions:
    """op_<name>(modifiers, operands) is the C++ of an instruction, or None for a form that is not known. Operands are
    read and written by the function that they are in."""

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

    def place(self, m, operand):
        """Address of a memory access."""
        address = self.address(operand)
        return f"lane.shared_address({address})" if "shared" in m else address

    def op_ld(self, m, o):
        kind, place = m[-1], self.place(m, o[1])
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
        kind, place = m[-1], self.place(m, o[0])
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
        place = self.place(m, o[1])
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

    def op_shf(self, m, o):
        if m != ["l", "wrap", "b32"]:
            return None
        low, high, count = (self.read(one, "u32") for one in o[1:])
        return self.write(o[0], f"u32(((u64({high}) << 32U) | {low}) << ({count} & 31U) >> 32U)", "u32")

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
