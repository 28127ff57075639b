#!/usr/bin/env python3
"""Checks that each constant of an algorithm, and each formula of a page of docs/math, is defined in one place.

Usage: lint_constants.py [--root DIR] [--self-test]

A `constexpr ... kName = value` whose value is written in numbers or text is defined once under its name, at whatever scope.
The values 0 and 1 are exempt: traits of templates repeat them. Two files share at most two distinctive numbers, under
whatever names. An algorithm that is written again has other names for the same numbers. A page of docs/math has each
formula number once, and a source cites formulas that are there. Each finding is printed as `file:line: sentence`; the
exit status is then 1.
"""

import collections
import itertools
import math
import re
import sys

import lint_tools
from lint_includes import strip_comments

FOLDERS = ["core", "cuda", "cpu_fallback", "distributed"]
SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".inc", ".in"}
# Pairs of files that share numbers for another reason than an algorithm.
EXEMPT = {
    ("core/graph/svg_island.cpp", "core/runtime/cones/pyramid.cpp"): "sines of multiples of 22.5 degrees",
}
TRIVIAL = {"0", "1", "0.0", "1.0"}
MOST_SHARED = 2

DEFINITION = re.compile(r"\bconstexpr\b[^;={}()\"]*?\b(k[A-Z]\w*\s*(?:\[\w*\]\s*)?[={][^;]*);", re.S)
DECLARATOR = re.compile(r"\s*(k[A-Z]\w*)\s*(?:\[\w*\]\s*)?(?:=\s*(.*)|\{(.*)\})\s*$", re.S)
CAST = re.compile(r"\b(?:std::)?\w+(?:<\w+>)?[({]([^(){}]*)[)}]")
FORMULA = re.compile(r"^ {4}.*\S\s+\((\d+)\)\s*$|\\tag\{(\d+)\}", re.M)  # of a block of code, or in LaTeX
CITED = re.compile(r"docs/math/(\w+)\.md,((?:[\s/]*(?:\(\d+\)|to|and|,|-))+)")


def declarators(text):
    """Parts of `a = 1, b = {2, 3}` between the commas that are in no bracket and no string."""
    depth = start = 0
    quoted = False
    for i, letter in enumerate(text):
        if letter == '"' and text[i - 1] != "\\":
            quoted = not quoted
        depth += 0 if quoted else (letter in "({[") - (letter in ")}]")
        if letter == "," and depth == 0 and not quoted:
            yield start, text[start:i]
            start = i + 1
    yield start, text[start:]


def number(value):
    """The value in double, or None if it is no arithmetic of literals."""
    value = re.sub(r"(?<=\d)'(?=\d)", "", value)
    value = CAST.sub(r"(\1)", CAST.sub(r"(\1)", value))
    value = re.sub(r"\b(0x[0-9a-fA-F.]+p[+-]?\d+)[fFlL]?\b", lambda m: repr(float.fromhex(m[1])), value)
    value = re.sub(r"\b(0[xX][0-9a-fA-F]+|\d[\d.]*(?:[eE][+-]?\d+)?)(?:[uUlLfF]*)\b", r"\1", value)
    if not re.fullmatch(r"[0-9a-fA-FxX.eE+\-*/<>()\s]+", value):
        return None
    try:
        return float(eval(value, {"__builtins__": {}}))  # pylint: disable=eval-used
    except (SyntaxError, TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None


def is_distinctive(value):
    """Returns true for a number that two programs rarely share by chance: no small integer, no power of two or of ten."""
    value = abs(value)
    if not 0 < value < math.inf or (value <= 10 and value == int(value)):
        return False
    return math.frexp(value)[0] != 0.5 and not re.fullmatch(r"10*e.*", f"{value:.14e}".replace(".", ""))


def constants(text):
    """(line, name, value without blanks) of the constants whose values are written in numbers or text."""
    code = strip_comments(text, keep_strings=True)
    for definition in DEFINITION.finditer(code):
        for offset, part in declarators(definition[1]):
            found = DECLARATOR.match(part)
            value = re.sub(r"\s+", "", found[2] or found[3] or "") if found else ""
            if re.search(r'[\d"]', value) and not re.search(r"\bk[A-Z]", value) and value not in TRIVIAL:
                yield code.count("\n", 0, definition.start(1) + offset) + 1, found[1], value


def sources(root):
    for folder in FOLDERS:
        for file in sorted((root / folder).rglob("*")):
            if file.suffix in SUFFIXES and file.is_file():
                yield file.relative_to(root).as_posix(), file.read_text(encoding="utf-8")


def repeated_constants(texts):
    """Sentences for constants of one name and value, and for pairs of files that share many values."""
    first = {}
    numbers = collections.defaultdict(dict)  # file: value: name
    for path, text in texts.items():
        for line, name, value in constants(text):
            where = first.setdefault((name, value), f"{path}:{line}")
            if where != f"{path}:{line}":
                yield f"{path}:{line}: {name} = {value} is defined in {where}; define it once, or name it for what it means here"
            amount = number(value)
            if amount is not None and is_distinctive(amount):
                numbers[path][amount] = name
    for one, other in itertools.combinations(sorted(numbers), 2):
        shared = sorted(numbers[one].keys() & numbers[other].keys())
        if len(shared) > MOST_SHARED and (one, other) not in EXEMPT:
            pairs = ", ".join(f"{numbers[one][v]} = {numbers[other][v]} = {v:g}" for v in shared)
            yield f"{other}:1: shares {len(shared)} constants with {one}: {pairs}; is it one algorithm written twice?"


def formula_problems(root, texts):
    """Sentences for formulas of docs/math that have one number, and for citations of a formula that is not there."""
    formulas = {}
    for page in sorted((root / "docs/math").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        seen = formulas[page.stem] = {}
        for formula in FORMULA.finditer(text):
            line, number = text.count("\n", 0, formula.start(formula.lastindex)) + 1, formula[formula.lastindex]
            if seen.setdefault(number, line) != line:
                yield f"docs/math/{page.name}:{line}: formula ({number}) is defined in line {seen[number]}, too"
    for path, text in texts.items():
        for citation in CITED.finditer(text):
            for cited in re.findall(r"\((\d+)\)", citation[2]):
                if cited not in formulas.get(citation[1], {}):
                    line = text.count("\n", 0, citation.start()) + 1
                    yield f"{path}:{line}: docs/math/{citation[1]}.md has no formula ({cited})"


def check_tree(root):
    texts = dict(sources(root))
    return len(texts), [*repeated_constants(texts), *formula_problems(root, texts)]


def self_test():
    """Each definition that is planted in a small clean tree is found."""
    clean = {
        "core/algorithm/sweep/sweep.hpp": "inline constexpr int kSweeps = 48, kMost = 3072;\nconstexpr double kPart = 1e-2, kSlope = 7e-2;\n",
        "core/algorithm/newton/loop.hpp": "/// kSweeps = 48 (docs/math/newton.md, (1) and (2)).\nstatic constexpr int kMine = kSweeps;\n"
                                          "template <class T> constexpr int kLanes = 1;\n",
        "cuda/kernels/warp.hpp": "constexpr int kLanes = 1;\nconstexpr Offset kBytes = Offset{1} << 29;\n",
        "docs/math/newton.md": "# Newton\n\n    x = y      (1)\n    y = z      (2)\n",
    }
    planted = [
        ("cuda/kernels/warp.hpp", "constexpr Index kSweeps = 48;", "kSweeps = 48 is defined in core/algorithm/sweep/sweep.hpp:1"),
        ("cuda/kernels/warp.hpp", "  static constexpr int kOther = 7, kMost{3072};", "kMost = 3072 is defined"),
        ("core/algorithm/newton/loop.hpp", 'constexpr const char* kInk = "#333";\nconstexpr const char* kInk = "#333";', "kInk"),
        ("core/algorithm/newton/loop.hpp", "constexpr Offset kBytes = Offset{1} << 29;", "kBytes = Offset{1}<<29"),
        ("core/algorithm/newton/loop.hpp", "constexpr int kA = 48, kB = 3'072;\nconstexpr double kC = 0.12, kD = 1e-2;", None),
        ("distributed/b.hpp", "constexpr int kA = 48, kB = 3'072;\nconstexpr double kC = 0.07;",
         "distributed/b.hpp:1: shares 3 constants with core/algorithm/sweep/sweep.hpp: kSlope = kC = 0.07, kSweeps = kA = 48"),
        ("docs/math/newton.md", "\n    a = b      (2)", "formula (2) is defined in line 4, too"),
        ("docs/math/newton.md", "\n```math\na = b \\tag{2}\n```\n", "formula (2) is defined in line 4, too"),
        ("cuda/kernels/warp.hpp", "/// Steps (docs/math/newton.md, (1) to\n/// (3)).", "newton.md has no formula (3)"),
    ]
    return lint_tools.test_planted(check_tree, clean, [(path, lines + "\n", expected) for path, lines, expected in planted])


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
