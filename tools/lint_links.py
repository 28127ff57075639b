#!/usr/bin/env python3
"""Checks that every relative link of the project's Markdown leads somewhere, and every test that a script names is there.

A link leads to a file or folder of the checkout. Its fragment, where it has one, leads to a heading of that page. The
rule is GitHub's: lower case, spaces become hyphens, punctuation is left out. Code is not read. A script's
unit_test_solver, or a pattern that begins so, is test_solver.cpp in a folder of tests/unit.

    tools/lint_links.py [--root DIR] [--self-test]
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import urllib.parse

import lint_tools

LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#{1,6}\s+(.*?)\s*#*$", re.M)
CODE = re.compile(r"^ {0,3}```.*?^ {0,3}```|^(?: {4}|\t)[^\n]*$|`(?:[^`\n]|\n(?!\s*\n))+`", re.M | re.S)
TEST = re.compile(r"\b(unit|algorithm|twin|determinism|accuracy)_(test_\w*)")


def anchors(text):
    """Fragments of a page's headings; a second heading of the same text gets -1, a third -2."""
    seen = {}
    found = set()
    for heading in HEADING.findall(re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        count = seen.get(slug, 0)
        seen[slug] = count + 1
        found.add(slug if count == 0 else f"{slug}-{count}")
    return found


def markdown(root):
    try:
        listed = subprocess.run(["git", "-C", root, "ls-files", "-co", "--exclude-standard", "*.md"], capture_output=True,
                                text=True, check=True).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):  # an archive without history
        listed = [str(path.relative_to(root)) for path in root.rglob("*.md")]
    return [root / name for name in listed if (root / name).is_file()]


def problems(root):
    pages = {page.resolve(): page.read_text(encoding="utf-8") for page in markdown(root)}
    for page, text in pages.items():
        for match in LINK.finditer(CODE.sub(lambda code: re.sub(r"[^\n]", " ", code.group()), text)):
            target = match.group(1)
            if re.match(r"[a-z]+:", target):
                continue
            path, _, fragment = urllib.parse.unquote(target).partition("#")
            to = (page.parent / path).resolve() if path else page
            where = f"{page.relative_to(root)}:{text.count(chr(10), 0, match.start()) + 1}"
            if not to.exists():
                yield f"{where}: {target} does not exist"
            elif fragment and to.suffix == ".md" and fragment not in anchors(pages.get(to) or to.read_text("utf-8")):
                yield f"{where}: {target}: the page has no such heading"


def missing_tests(root):
    """Names of test programs in scripts and tools whose source is not there."""
    for script in sorted([*root.glob("scripts/*"), *root.glob("tools/*.py"), *root.glob(".ci/*")]):
        text = script.read_text(encoding="utf-8") if script.is_file() and script != root / "tools/lint_links.py" else ""
        for match in TEST.finditer(text):
            if not any((root / "tests" / match.group(1)).rglob(match.group(2) + "*.cpp")):
                yield (f"{script.relative_to(root)}:{text.count(chr(10), 0, match.start()) + 1}: there is no test "
                       f"{match.group()}")


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        (root / "other.md").write_text("# A heading, with `code`\n\n## Twice\n\n## Twice\n")
        (root / "page.md").write_text(
            "[here](other.md#a-heading-with-code) [again](other.md#twice-1) [web](https://example.org/x) `[no](link)`\n"
            "[gone](missing.md)\n[no such](other.md#nothing)\n[own](#nowhere)\n")
        (root / "scripts").mkdir()
        (root / "scripts/test.sh").write_text("ctest -E 'unit_test_here|unit_test_h.*'\nninja unit_test_gone\n")
        (root / "tests/unit/solve").mkdir(parents=True)
        (root / "tests/unit/solve/test_here.cpp").touch()
        found = [*problems(root), *missing_tests(root)]
    expected = ["page.md:2: missing.md does not exist", "page.md:3: other.md#nothing: the page has no such heading",
                "page.md:4: #nowhere: the page has no such heading",
                "scripts/test.sh:2: there is no test unit_test_gone"]
    if found != expected:
        print("\n".join(["expected", *expected, "found", *found]))
        return 1
    print(f"{len(expected)} planted problems found, and no others")
    return 0


def check_tree(root):
    root = root.resolve()
    return len(markdown(root)), [*problems(root), *missing_tests(root)]


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
