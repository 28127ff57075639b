"""PTX as text: types, operands, parameters and statements (NVIDIA, "PTX ISA", version 9.0, sections 4 and 5)."""

import re

BYTES = {"pred": 1, "b8": 1, "u8": 1, "s8": 1, "b16": 2, "u16": 2, "s16": 2, "b32": 4, "u32": 4, "s32": 4, "f32": 4,
         "b64": 8, "u64": 8, "s64": 8, "f64": 8}
FLOATS = ("f32", "f64")
#: Values of registers that are no variables. Blocks have two dimensions, grids one.
SPECIAL = {"%tid.x": "(lane.thread % lane.width)", "%tid.y": "(lane.thread / lane.width)", "%tid.z": "0",
           "%ntid.x": "lane.width", "%ntid.y": "(lane.block_size / lane.width)", "%ntid.z": "1",
           "%ctaid.x": "lane.block", "%ctaid.y": "0", "%ctaid.z": "0",
           "%nctaid.x": "lane.blocks", "%nctaid.y": "1", "%nctaid.z": "1", "%laneid": "(lane.thread % 32)",
           "%envreg1": "lane.grid_word(1)", "%envreg2": "lane.grid_word(0)"}
COMPARISONS = {"eq": "==", "lt": "<", "le": "<=", "gt": ">", "ge": ">=", "lo": "<", "ls": "<=", "hi": ">", "hs": ">="}
UNORDERED = {"equ": "==", "neu": "!=", "ltu": "<", "leu": "<=", "gtu": ">", "geu": ">="}
ATOMICS = ("add", "or", "and", "max", "min", "exch")


class PtxError(Exception):
    """Raised for text that cannot be translated, with a sentence."""


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
