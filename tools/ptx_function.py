"""One function of PTX as a function of C++."""

import re

from ptx_instructions import Instructions
from ptx_text import BYTES, FLOATS, SPECIAL, PtxError, cpp, identifier, parameters, split


class Function(Instructions):
    """One function, being translated."""

    def __init__(self, module, symbols):
        self.module = module
        self.symbols = dict(symbols)  # name -> C++ expression of its address
        self.types = {}  # register -> PTX type
        self.depot = None  # (C++ name, alignment, bytes) of memory on the stack
        self.code = []
        self.counted = 0  # instructions since the last place where control can enter or leave

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

    def count(self, *_):
        """Ends a straight piece of code: adds its count to the lane's."""
        if self.counted:
            self.code.append(f"lane.count({self.counted});")
        self.counted = 0

    def add(self, statement):
        if statement in "{}":
            self.code.append(statement)
        elif statement.endswith(":"):
            self.label(identifier(statement[:-1]))
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

    def label(self, name):
        self.count()
        self.code.append(f"{name}:;")

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
        self.counted += 1
        self.count()
        given = [self.symbols[name] for name in split(match[3] or "")]
        self.code.append(self.called(f"{self.module.functions[match[2]]}({', '.join(['lane', match[1] or 'nullptr'] + given)});"))

    @staticmethod
    def called(text):
        return text

    def instruction(self, statement):
        match = re.fullmatch(r"(?:@(!?)%(\w+) )?([a-z][\w.:]*)(?: (.*))?", statement)
        if match is None:
            raise PtxError(f"an instruction of unknown form: {statement}")
        parts = match[3].split(".")
        self.module.seen[match[3]] += 1
        self.counted += 1
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
            self.count(identifier(match[4]) if parts[0] == "bra" else None, bool(match[2]))
        guard = f"if ({match[1]}{identifier(match[2])}) " if match[2] else ""
        self.code.append(f"{guard}{{ {text} }}" if guard else text)
