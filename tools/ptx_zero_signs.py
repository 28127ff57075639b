"""Finds where the sign of a zero may differ between PTX and host, because nvcc wrote select(x < 0, x, 0) as min(x, +0).

The minimum of -0 and +0 is -0 in PTX, and +0 on the host. Nothing else differs: where x is NaN both give +0. `reached`
follows such zeros through a function. A product of a number with itself, or with a multiple of itself, has a sign that
does not depend on them. Neither has a sum with +0, and a comparison does not see them. Any other sum or product, and a
copy, pass them on. A value that is stored, divided by, or handed to a function while they are in it is a finding.
"""

import re

FUNCTION = re.compile(r"\.(?:entry|func)\s+(?:\([^)]*\)\s*)?(\w+)")
INSTRUCTION = re.compile(r"^\s*(?:@!?%\w+\s+)?([a-z][a-z0-9_]*(?:\.[A-Za-z0-9_:]+)*)\s+(.*);\s*$")
OPERAND = re.compile(r"%\w+|0[fd][0-9A-Fa-f]+|[^\s,{}\[\]%]+")
VECTOR = re.compile(r"\s*\{([^}]*)\}")
ZERO = {"0f00000000", "0d0000000000000000"}
FLOAT = {"f32", "f64"}
PASSED_ON = {"add", "sub", "neg", "mov", "selp", "cvt", "sqrt"}
NOT_SEEN = {"setp", "abs", "testp"}


class Instruction:
    def __init__(self, number, operation, operands):
        self.number, self.operation = number, operation
        self.name = operation.split(".")[0]
        self.is_float = bool(FLOAT & set(operation.split(".")))
        self.operands = OPERAND.findall(operands)
        vector = VECTOR.match(operands)
        made = len(OPERAND.findall(vector.group(1))) if vector else 1
        if self.name in {"st", "call", "red"}:
            made = 0
        self.results, self.sources = self.operands[:made], self.operands[made:]

    def is_zero_minimum(self):
        return self.name == "min" and self.is_float and len(self.operands) == 3 and self.operands[2] in ZERO


class Function:
    """One function's instructions and the registers whose zeros have a sign that is not the host's."""

    def __init__(self, instructions):
        self.instructions = instructions
        self.made_by = {}
        for one in instructions:
            for result in one.results:
                self.made_by.setdefault(result, []).append(one)
        self.open = set()

    def is_multiple(self, product, of):
        """Returns true if a register is always a closed number times another register."""
        made = self.made_by.get(product, [])
        if len(made) != 1 or made[0].name != "mul" or not made[0].is_float:
            return False
        left, right = made[0].sources
        return (right == of and left not in self.open) or (left == of and right not in self.open)

    def closes(self, left, right):
        """Returns true if the sign of a product does not depend on the open zeros of its factors."""
        if left not in self.open and right not in self.open:
            return True
        return left == right or self.is_multiple(left, right) or self.is_multiple(right, left)

    def passes_on(self, one):
        """Returns true if an instruction leaves its result open. None: it must not be given open numbers."""
        if one.is_zero_minimum():
            return True
        if not self.open.intersection(one.sources) or one.name in NOT_SEEN:
            return False
        if not one.is_float:
            return None
        if one.name == "add" and ZERO & set(one.sources):
            return False
        if one.name == "mul":
            return not self.closes(*one.sources)
        if one.name == "fma":
            return not self.closes(*one.sources[:2]) or one.sources[2] in self.open
        if one.name == "div":
            return None if one.sources[1] in self.open else True
        if one.name == "max":  # with a literal >= +0, which check_ptx.py asks for
            return False
        return True if one.name in PASSED_ON or one.name == "min" else None

    def findings(self):
        grows = True
        while grows:
            grows = False
            for one in self.instructions:
                if self.passes_on(one) and not self.open.issuperset(one.results):
                    self.open.update(one.results)
                    grows = True
        return [one for one in self.instructions if self.passes_on(one) is None]


def functions(text):
    """(name, instructions) of a PTX text."""
    name, found = "?", []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.split("//")[0]
        header = FUNCTION.search(line)
        if header:
            if found:
                yield name, found
            name, found = header.group(1), []
        match = INSTRUCTION.match(line)
        if match:
            found.append(Instruction(number, *match.groups()))
    if found:
        yield name, found


def reached(text):
    """(line, operation, function) of uses of such a zero's sign."""
    return [(one.number, one.operation, name) for name, found in functions(text)
            if any(one.is_zero_minimum() for one in found) for one in Function(found).findings()]


def self_test():
    """Texts of one function each, with the operations that are to be found."""
    start = "min.f32 %f1, %f9, 0f00000000;"
    cases = [
        (["mul.rn.f32 %f2, %f1, %f1;", "st.global.f32 [%rd1], %f2;"], []),
        (["mul.rn.f32 %f2, %f8, %f1;", "fma.rn.f32 %f3, %f2, %f1, %f7;", "st.global.f32 [%rd1], %f3;"], []),
        (["mul.rn.f32 %f2, %f1, %f8;", "mul.rn.f32 %f3, %f1, %f2;", "st.global.f32 [%rd1], %f3;"], []),
        (["setp.lt.f32 %p1, %f1, %f8;", "abs.f32 %f2, %f1;", "st.global.f32 [%rd1], %f2;"], []),
        (["add.rn.f32 %f2, %f1, 0f00000000;", "st.global.f32 [%rd1], %f2;"], []),
        (["st.global.f32 [%rd1], %f1;"], ["st.global.f32"]),
        (["mov.f32 %f2, %f1;", "st.local.f32 [%rd1], %f2;"], ["st.local.f32"]),
        (["mul.rn.f32 %f2, %f1, %f8;", "st.global.f32 [%rd1], %f2;"], ["st.global.f32"]),
        (["mul.rn.f32 %f2, %f8, %f1;", "mov.f32 %f2, %f7;", "fma.rn.f32 %f3, %f2, %f1, %f7;", "st.global.f32 [%rd1], %f3;"],
         ["st.global.f32"]),
        (["mul.rn.f32 %f2, %f8, %f1;", "fma.rn.f32 %f3, %f2, %f6, %f7;", "st.global.f32 [%rd1], %f3;"], ["st.global.f32"]),
        (["add.rn.f32 %f2, %f8, %f1;", "st.param.f32 [param0], %f2;"], ["st.param.f32"]),
        (["div.rn.f32 %f2, %f8, %f1;"], ["div.rn.f32"]),
        (["div.rn.f32 %f2, %f1, %f8;", "st.global.f32 [%rd1], %f2;"], ["st.global.f32"]),
        (["shfl.sync.bfly.b32 %r1|%p1, %f1, 16, 31, -1;"], ["shfl.sync.bfly.b32"]),
        (["mov.b32 %r1, %f1;"], ["mov.b32"]),
        (["st.global.v2.f32 [%rd1], {%f1, %f7};"], ["st.global.v2.f32"]),
        (["st.global.v2.f32 [%rd1], {%f7,%f1};"], ["st.global.v2.f32"]),
        (["mul.rn.f32 %f2, %f8, %f1;", "ld.global.v2.f32 {%f3, %f2}, [%rd1];", "fma.rn.f32 %f4, %f2, %f1, %f7;",
          "st.global.f32 [%rd1], %f4;"], ["st.global.f32"]),
    ]
    wrong = [(lines, found, expected) for lines, expected in cases
             if (found := [operation for _, operation, _ in
                           reached("\n".join([".func f(", start, *lines]))]) != expected]
    return [f"{lines}: found {found}, not {expected}" for lines, found, expected in wrong]
