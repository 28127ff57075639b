"""Sentences of pages, comments and docstrings, and how many words each has.

A unit is a text that no sentence leaves. It is a paragraph, an item of a list, a cell of a table, a docstring, or the
comment lines that follow one another. Code blocks, headings, pictures and the targets of links are left out. Inline
code and a formula between dollars are a word each. A token without a letter or a digit (a dash, an equals sign) is not
counted.
"""

import ast
import io
import pathlib
import re
import tokenize

C_SUFFIXES = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".c", ".inc"}

FENCE = re.compile(r"\s*(```|~~~)")
ITEM = re.compile(r"(\s*)([*+-]|\d+[.)])(\s+)(?=\S)")
SKIPPED = re.compile(r"\s*(#{1,6}\s|\[[^\]]+\]:|[-=*_]{3,}\s*$|!\[[^\]]*\]\([^)]*\)\s*$|<!--.*-->\s*$)")
CELL_BORDER = re.compile(r"(?<!\\)\|")
ALIGNED = re.compile(r"\s*\S.* {3,}\S")  # a row of a table by blanks
ARGUMENT = re.compile(r"\s*[a-z_]\w*(, [a-z_]\w*)*: ")  # of a Python function, in its docstring
TAG = re.compile(r"\s*[@\\](param|tparam|return|returns|throws|brief|pre|post|note|file)\b")

CODE_SPAN = re.compile(r"(`+)(?!`).+?(?<!`)\1(?!`)|\$[^$\n]+\$")
PICTURE = re.compile(r"!\[[^\]]*\]\([^)]*\)")
LINK = re.compile(r"\[([^\]]*)\](\([^)]*\)|\[[^\]]*\])")
ABBREVIATION = re.compile(r"\b(e\.g|i\.e|cf|vs|ca|resp|approx|incl|Fig|Figs|Eq|Eqs|Sec|Ch|No|pp|al|etc)\.(?=\s)")
SENTENCE_END = re.compile(r"(?<=[.?!])(?<!\.\.)[)\]\"'*_”]*(?:\s+(?![+=·…]\s)|$)")

# Strings first, so that comments inside them are skipped.
C_TOKEN = re.compile(r"""R"(?P<delimiter>\w*)\(.*?\)(?P=delimiter)"|"(?:\\.|[^"\\\n])*"|'(?:\\[^\n]+?|[^'\\\n])'"""
                     r"""|(?P<line>//[^\n]*)|(?P<block>/\*.*?\*/)""", re.DOTALL)


def markdown_units(text, arguments=False):
    """Pairs (line number from 1, text) of a page's paragraphs, list items and table cells. A line that is indented less
    than the one before begins a unit, and so does one about an argument, if there are `arguments`."""
    units, lines, start, indent = [], [], 0, 0
    fence, in_list, blank_before = None, 0, True

    def flush():
        nonlocal lines
        if lines:
            units.append((start, " ".join(lines)))
        lines = []

    for number, line in enumerate(text.splitlines(), start=1):
        line = re.sub(r"^\s*> ?", "", line)
        mark = FENCE.match(line)
        if mark and fence in (None, mark[1]):
            flush()
            fence = None if fence else mark[1]
            continue
        if fence:
            continue
        before, indent = indent, len(line) - len(line.lstrip())
        item = ITEM.match(line)
        if not line.strip() or SKIPPED.match(line):
            flush()
            in_list = 0 if line.startswith("#") else in_list
            blank_before = True
            continue
        if blank_before and not item and indent < 2:
            in_list = 0
        if not lines and indent >= 4 + in_list:  # a code block
            blank_before = True
            continue
        blank_before = False
        if line.lstrip().startswith("|"):
            flush()
            units += [(number, cell.strip()) for cell in CELL_BORDER.split(line.strip()) if cell.strip()]
            continue
        argument = arguments and ARGUMENT.match(line) and (not lines or lines[-1].endswith((".", ":")))
        if item or argument or indent < before or TAG.match(line) or ALIGNED.match(line):
            flush()
            in_list = len(item[0]) if item else in_list
            indent = len(item[0]) if item else indent
            line = line[len(item[0]):] if item else line
        if not lines:
            start = number
        lines.append(line.strip())
    flush()
    return units


def shifted(units, number):
    """`units` of a text that begins at line `number` of its file."""
    return [(number + line - 1, text) for line, text in units]


def c_comments(text):
    """Pairs (line number, text) of the comments of a C++, CUDA or C source. `//` lines below one another are one text."""
    found = []
    last = (-2, -1)  # line and column of the `//` before
    for match in C_TOKEN.finditer(text):
        if not match["line"] and not match["block"]:
            continue
        number = text.count("\n", 0, match.start()) + 1
        before = text[text.rfind("\n", 0, match.start()) + 1:match.start()]
        if match["block"]:
            lines = re.sub(r"^/\*+<? ?|\s*\*/$", "", match[0]).split("\n")
            found.append((number, "\n".join(re.sub(r"^\s*\* ?", "", line) for line in lines)))
            continue
        body = re.sub(r"^//[/!]?<? ?", "", match[0])
        if not before.strip() and last == (number - 1, len(before)):
            found[-1] = (found[-1][0], found[-1][1] + "\n" + body)
        else:
            found.append((number, body))
        last = (number, len(before))
    return found


def python_comments(text):
    """Pairs (line number, text) of the docstrings and of the comments of a Python source."""
    found = []
    try:
        tree = ast.parse(text)
        tokens = list(tokenize.generate_tokens(io.StringIO(text).readline))
    except (SyntaxError, tokenize.TokenError):
        return found
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)) and ast.get_docstring(node):
            found.append((node.body[0].lineno, ast.get_docstring(node)))
    last = (-2, -1)
    for token in tokens:
        if token.type != tokenize.COMMENT:
            continue
        body = re.sub(r"^#!?:? ?", "", token.string)
        if not token.line[:token.start[1]].strip() and token.start == (last[0] + 1, last[1]):
            found[-1] = (found[-1][0], found[-1][1] + "\n" + body)
        else:
            found.append((token.start[0], body))
        last = token.start
    return found


def script_comments(text):
    """Pairs (line number, text) of the comments of a shell or CMake source that have lines of their own."""
    return [(text.count("\n", 0, match.start()) + 1, re.sub(r"^\s*#+ ?", "", match[0], flags=re.MULTILINE))
            for match in re.finditer(r"(?:^[ \t]*#(?!!).*\n)+", text, re.MULTILINE)]


def units_of(path, text):
    """Units of a file; none of one that is neither a page nor a C++, CUDA, C, Python, shell or CMake source."""
    name = path.removesuffix(".in")
    suffix = pathlib.PurePosixPath(name).suffix
    if suffix == ".md":
        return markdown_units(text)
    comments = c_comments(text) if suffix in C_SUFFIXES else python_comments(text) if suffix == ".py" else []
    if suffix in {".sh", ".cmake"} or name.endswith("CMakeLists.txt"):
        comments = script_comments(text)
    return [unit for number, comment in comments for unit in shifted(markdown_units(comment, suffix == ".py"), number)]


def sentences(unit):
    """Sentences of a unit, without its markup."""
    plain = CODE_SPAN.sub("code", unit)
    plain = LINK.sub(r"\1", PICTURE.sub("", plain))
    plain = ABBREVIATION.sub(lambda match: match[0].replace(".", ""), plain)
    return [sentence.strip() for sentence in SENTENCE_END.split(plain) if sentence.strip()]


def word_count(sentence):
    """Words of a sentence: tokens with a letter or a digit."""
    return sum(any(c.isalnum() for c in token) for token in sentence.split())


def sentences_of(path, text):
    """Pairs (line number, sentence) of a file."""
    return [(number, sentence) for number, unit in units_of(path, text) for sentence in sentences(unit)]


def long_sentences(path, text, max_words):
    """Triples (line number, words, sentence) of a file's sentences of more than `max_words` words."""
    return [(number, word_count(sentence), sentence) for number, unit in units_of(path, text)
            for sentence in sentences(unit) if word_count(sentence) > max_words]


def messages(path, text):
    """Pairs (line number, text) of the string literals of several words in a C++, CUDA, C or Python source."""
    suffix = pathlib.PurePosixPath(path.removesuffix(".in")).suffix
    if suffix in C_SUFFIXES:
        found = [(text.count("\n", 0, match.start()) + 1, match[0].strip('"')) for match in C_TOKEN.finditer(text)
                 if match[0].startswith('"')]
    elif suffix == ".py":
        tree = ast.parse(text)
        found = [(node.lineno, node.value) for node in ast.walk(tree)
                 if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    else:
        found = []
    return [(number, " ".join(message.split())) for number, message in found if len(message.split()) > 3]
