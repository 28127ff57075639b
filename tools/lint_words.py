#!/usr/bin/env python3
"""Finds words that promise later work, paths of one machine, comments without a subject, and names of tests in another
style. Finds sentences that begin without their subject (sentences.py defines one), and files and lines of prose that
grew too long. Long sentences are printed as warnings.

Usage: lint_words.py [--root DIR] [--self-test]
"""

import pathlib
import re
import subprocess
import sys

import lint_tools
import sentences

CODE = {".hpp", ".cpp", ".cu", ".cuh", ".h", ".c", ".inc", ".py", ".sh", ".cmake", ".txt"}
TEXT = CODE | {".md", ".json", ".yml", ".yaml", ".cff", ".in", ".toml"}
MAX_LINES = 400  # of code; beyond this a file holds more than one idea
# Longer, and why.
LONG_TABLES = {"tests/support/golden/hashes.inc": "hashes of every case, recorded by tools/update_goldens.py"}
# The rules themselves spell the words they look for.
SPELLS_THE_WORDS = {"tools/lint_words.py"}

# The words are put together here so that a search for them finds unfinished work and not this list.
LATER = re.compile(r"\b(TO" r"DO|FIX" r"ME|XX" r"X|not imple" r"mented|place" r"holder|for n" r"ow|st" r"ubs?)\b")
# Data, code and machines are not persons: name the actor, or use the passive.
PERSON = re.compile(r"\b(who" r"ever|who" r"m|no" r"body|some" r"body|every" r"body|any" r"body)\b", re.IGNORECASE)
# A reader comes to a declaration by name, not from the one above it.
NO_SUBJECT = re.compile(r"\s*(?:///|/\*\*) (The same|Both|Else|All else)\b")
MAX_WORDS = 25  # of a sentence, in pages, comments and docstrings
# A sentence begins with its subject, not with a clause that stands in for it.
HEADLESS = re.compile(r"[\W_]*(What|Whether|Where|Of|That|Those|Who|So)\b(?!['’])")
AS_WRITTEN = re.compile(r"bench/(results/.+|log)/")  # records of their day
MAX_COLUMNS = 120  # of prose; tables, pictures and code are as wide as they are
WIDE = re.compile(r"\||!\[|```|    |\t|\S+$")
GENERATED = re.compile(r"bench/results/.+/")
MACHINE_PATH = re.compile(r"(?<![\w.$}])/(work|root|home/\w+)/\w")
# GoogleTest: Suite.SentenceInCamelCase (its own rule: no underscores); Python: test_sentence_in_snake_case.
GOOGLE_TEST = re.compile(r"^(?:TYPED_)?TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)", re.MULTILINE)
GOOGLE_NAME = re.compile(r"[A-Z][A-Za-z0-9]*$")
PYTHON_TEST = re.compile(r"^ *def (test\w*)\(", re.MULTILINE)
PYTHON_NAME = re.compile(r"test(_[a-z0-9]+)+$")
MACRO = re.compile(r"^\s*#\s*define\s+(\w+)")
MACROS_ALLOWED = re.compile(r"STICTION_\w+$")


def problems_of(path, text):
    """Sentences for one file; `path` decides which rules speak."""
    found = []
    suffix = pathlib.PurePosixPath(path.removesuffix(".in")).suffix  # a template is its result
    is_prose = suffix == ".md" and not GENERATED.match(path)
    before = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if line.startswith("```") and suffix == ".md" and not GENERATED.match(path):
            is_prose = not is_prose
        if is_prose and len(line) >= MAX_COLUMNS and not WIDE.match(line):
            found.append(f"{path}:{number}: {len(line)} columns; prose ends before {MAX_COLUMNS}")
        if suffix in {".hpp", ".cpp", ".cu", ".cuh", ".h"} and NO_SUBJECT.match(line) and not before.lstrip().startswith("///"):
            found.append(f"{path}:{number}: '{NO_SUBJECT.match(line).group(1)}' of what? Repeat the subject")
        before = line
        if suffix in CODE and path not in SPELLS_THE_WORDS and LATER.search(line):
            found.append(f"{path}:{number}: '{LATER.search(line).group(0)}' promises later work; do it or drop it")
        if path not in SPELLS_THE_WORDS and MACHINE_PATH.search(line):
            found.append(f"{path}:{number}: '{MACHINE_PATH.search(line).group(0)}...' is a path of one machine")
        if path not in SPELLS_THE_WORDS and not GENERATED.match(path) and suffix in CODE | {".md"} and PERSON.search(line):
            found.append(f"{path}:{number}: '{PERSON.search(line).group(0)}' is a person; say what does it")
        macro = MACRO.match(line)
        if macro and suffix in {".hpp", ".cuh", ".h"} and not MACROS_ALLOWED.match(macro.group(1)):
            found.append(f"{path}:{number}: macro {macro.group(1)} must begin with STICTION_")
        if line != line.rstrip():
            found.append(f"{path}:{number}: trailing blanks")
    if suffix in {".hpp", ".cpp", ".cu"}:
        for suite, name in GOOGLE_TEST.findall(text.replace("@", "")):
            if not GOOGLE_NAME.match(suite) or not GOOGLE_NAME.match(name.removeprefix("DISABLED_")):
                found.append(f"{path}: the test {suite}.{name} is named Suite.SentenceInCamelCase")
    if suffix == ".py" and re.search(r"(^|/)tests/", path):
        for name in PYTHON_TEST.findall(text):
            if not PYTHON_NAME.match(name):
                found.append(f"{path}: the test {name} is named test_sentence_in_snake_case")
    if not AS_WRITTEN.match(path):
        found += [f"{path}:{number}: a sentence begins with '{HEADLESS.match(sentence).group(1)}'; begin with its subject"
                  for number, sentence in sentences.sentences_of(path, text) if HEADLESS.match(sentence)]
    lines = text.count("\n")
    if suffix in CODE and path not in LONG_TABLES and lines > MAX_LINES:
        found.append(f"{path}:{lines}: {lines} lines; a file holds one idea in at most {MAX_LINES}")
    if text and not text.endswith("\n"):
        found.append(f"{path}: no newline at the end")
    return found


def warnings_of(path, text):
    """Sentences about a file that do not fail the check."""
    if GENERATED.match(path):
        return []
    return [f"{path}:{number}: warning: a sentence of {words} words, '{sentence[:60]}...'; make it {MAX_WORDS} at most"
            for number, words, sentence in sentences.long_sentences(path, text, MAX_WORDS)]


def tracked_files(root):
    """The files git knows, or every file outside hidden and build folders where there is no git."""
    listing = subprocess.run(["git", "-C", str(root), "ls-files", "-z"], capture_output=True, check=False)
    if listing.returncode == 0 and listing.stdout:
        return [name for name in listing.stdout.decode().split("\0") if name]
    found = []
    for file in sorted(root.rglob("*")):
        name = file.relative_to(root).as_posix()
        if file.is_file() and not re.match(r"(build|out|\.(?!ci/|github/))", name):
            found.append(name)
    return found


def sentence_cases():
    """Planted sentences that are too long, and texts that hold none."""
    def words(count, before=""):
        lines = [" ".join(["word"] * min(5, count - i)) for i in range(0, count, 5)]
        return f"\n{before}".join(lines)

    return [
        ("a.md", words(25) + ".\n", 0),
        ("a.md", words(26) + ".\n", 1),
        ("a.md", f"{words(20)}. {words(20)}?\n{words(20)}\n", 0),
        ("a.md", f"{words(20)}; {words(20)}.\n", 1),
        ("a.md", f"{words(20)}, e.g. {words(20)}.\n", 1),
        ("a.md", f"{words(20)} 1.5 {words(20)}.\n", 1),
        ("a.md", f"{words(22)} `a b` $c = d$ [a](b-c-d.md).\n", 0),
        ("a.md", f"{words(23)} `a b` $c = d$ [a](b-c-d.md).\n", 1),
        ("a.md", f"* {words(20, '  ')}\n* {words(20, '  ')}\n", 0),
        ("a.md", f"* {words(26, '  ')}\n", 1),
        ("a.md", f"| {'word ' * 20} | {'word ' * 20} |\n", 0),
        ("a.md", f"| {'word ' * 26} |\n", 1),
        ("a.md", f"# {'a ' * 30}a\n\n```\n{words(30)}\n```\n\n    {words(30, '    ')}\n", 0),
        ("a.hpp", f"/// {words(26, '/// ')}\n", 1),
        ("a.hpp", f"/// {words(20, '/// ')}\nint x;\n/// {words(20, '/// ')}\n", 0),
        ("a.hpp", f"int x;  ///< {words(26, '        ///< ')}\n", 1),
        ("a.h", f"/** {words(26, ' *  ')} */\n", 1),
        ("a.cpp.in", f"// {words(26, '// ')}\n", 1),
        ("a.cpp", f"auto x = \"// {'word ' * 26}\";\n", 0),
        ("a.py", f'"""{words(26)}"""\n', 1),
        ("a.py", f"x = 1\n# {words(26, '# ')}\n", 1),
        ("bench/results/here/a.md", words(26) + "\n", 0),
        ("docs/a.md", "What is left is zero. It is left.\n\n| Of a row |\n", 2),
        ("docs/a.md", "Whatever is left is zero. It says where.\n\n    That is code.\n", 0),
        ("bench/log/a.md", "What is left is zero.\n", 0),
        ("a.hpp", "/// So it is.\n", 1),
        ("a.sh", "#!/bin/sh\n# What is left.\nx=1  # Where it is\n", 1),
    ]


def self_test():
    """One planted problem per rule, and a clean file."""
    later = "TO" + "DO"
    cases = sentence_cases() + [
        ("a.cpp", "int x = 1;\n", 0),
        ("a.md", "the " + later + " list of a paper\n", 0),
        ("a.cpp", f"int x; // {later} later\n", 1),
        ("a.py", "x = 1  # place" + "holder\n", 1),
        ("a.md", "see /wo" + "rk/main/core\n", 1),
        ("a.sh", "x=$HOME/wo" + "rk/core\n", 0),
        ("a.md", "No" + "body waits.\n", 1),
        ("a.hpp", "/// for who" + "ever asks\n", 1),
        ("a.hpp", "/// The same of a pack.\n", 1),
        ("a.hpp", "/// A graph.\n/// The same graph gives the same text.\n", 0),
        ("a.md", "longer_word " * 15 + "end\n", 1),
        ("a.md", "| word " * 30 + "|\n```\n" + "word " * 30 + "end\n```\n", 0),
        ("a.hpp", "#define MIN(a) a\n", 1),
        ("a.hpp", "#define STICTION_HD inline\n", 0),
        ("a.cpp", "TEST(Suite, SaysWhat) {}\nTYPED_TEST(Suite, DISABLED_SaysWhat2) {}\n", 0),
        ("a.cpp", "TEST(suite, SaysWhat) {}\nTEST_F(Suite,\n       says_what) {}\n", 2),
        ("a.cpp.in", "TEST(suite, @Method@SaysWhat) {}\n", 1),
        ("tests/a.py", "def test_says_what():\n    pass\n", 0),
        ("tests/a.py", "class A:\n    def testSaysWhat(self):\n        pass\n", 1),
        ("a.cpp", "int x; \n", 1),
        ("a.cpp", "int x;", 1),
        ("a.cpp", "int x;\n" * MAX_LINES, 0),
        ("a.cpp", "int x;\n" * (MAX_LINES + 1), 1),
        ("a.c", "int x;\n" * (MAX_LINES + 1), 1),
        ("a.py", "x = 1\n" * (MAX_LINES + 1), 1),
        ("tests/support/golden/hashes.inc", "int x;\n" * (MAX_LINES + 1), 0),
    ]
    found = [(path, text, problems_of(path, text) + warnings_of(path, text), expected) for path, text, expected in cases]
    failed = [case for case in found if len(case[2]) != case[3]]
    for path, text, sayings, _ in failed:
        print(f"self-test: {path} with {text[:40]!r} gave {sayings}")
    print(f"self-test: {len(cases)} cases, {len(failed)} failed")
    return 1 if failed else 0


def check_tree(root):
    texts = {name: (root / name).read_text(encoding="utf-8") for name in tracked_files(root)
             if (root / name).suffix in TEXT and (root / name).is_file()}
    for name, text in texts.items():
        for warning in warnings_of(name, text):
            print(warning)
    return len(texts), [problem for name, text in texts.items() for problem in problems_of(name, text)]


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
