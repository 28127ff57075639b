#!/usr/bin/env python3
"""Writes the reference of the C++ and the C interface from the comments of the public headers, as Doxygen reads them.

    tools/api_reference.py FOLDER        pages in Markdown, below FOLDER
    tools/api_reference.py --check       names every public symbol without a comment
    tools/api_reference.py --self-test   checks that planted ones are found

Public are the declarations of the headers outside namespace detail: classes and their public members, functions,
enumerations with their values, constants, types. Members that the language writes (copies, moves, destructors,
defaults) need no comment. A comment behind several names of one type is about each of them.

Exit status 0 clean, 1 symbols without a comment, 77 that doxygen is not here (CTest counts it as skipped).
"""

import argparse
import dataclasses
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

from api_text import anchor_of, blocks, declaration, plain
from lint_tools import ROOT, SKIPPED

MACROS = ["STICTION_HD=", "STICTION_HD_OUTLINE=", "STICTION_API="]
SETTINGS = ("GENERATE_HTML=NO", "GENERATE_LATEX=NO", "GENERATE_XML=YES", "XML_PROGRAMLISTING=NO", "EXTRACT_ALL=YES", "QUIET=YES",
            "WARNINGS=NO", "MACRO_EXPANSION=YES", "EXPAND_ONLY_PREDEF=YES", "SORT_MEMBER_DOCS=NO", "DISTRIBUTE_GROUP_DOC=NO")


@dataclasses.dataclass
class Interface:
    """One language's public headers, and where their pages go."""

    language: str
    folder: str  # of the pages
    index: str   # page that lists them
    headers: str  # folder of the headers
    pattern: str
    include: str  # prefix of a header's name in an #include
    intro: str


CPP = Interface("C++", "docs/cpp", "docs/cpp_api.md", "core/include/stiction", "*.hpp", "stiction/",
                "Every name of the C++ interface, by header; all are in namespace `stiction`. Begin with the\n"
                "[first program](../examples/01_hello_batch.cpp) and [data layout](reference/data_layout.md).")
C = Interface("C", "docs/c", "docs/c_names.md", "c_api/include", "*.h*", "",
              "Every name of the C interface, by header. [The C interface](reference/c_api.md) has what holds for all of them.")


@dataclasses.dataclass
class Item:
    """A declaration: `node` is Doxygen's; members are those of a class, values those of an enumeration."""

    kind: str
    name: str
    node: ElementTree.Element
    members: list = dataclasses.field(default_factory=list)

    @property
    def place(self):
        where = self.node.find("location")
        return where.get("file"), int(where.get("line")), int(where.get("column") or 0)

    @property
    def is_documented(self):
        return any(plain(self.node.find(part)) for part in ("briefdescription", "detaileddescription"))


def is_written_by_language(item, owner):
    """Returns true if a member function is a destructor, a copy, a move or a default."""
    arguments = plain(item.node.find("argsstring"))
    name = item.name.rpartition("::")[2]
    return (name.startswith("~") or name == "operator=" or re.search(r"=\s*(default|delete)$", arguments) is not None
            or (name == owner and re.match(rf"\((const )?{owner} ?&&?( ?\w+)?\)", arguments) is not None))


def read_xml(interface, source):
    """Doxygen's compounds of the headers below `source`."""
    with tempfile.TemporaryDirectory() as folder:
        headers = pathlib.Path(folder, "headers")
        headers.mkdir()
        for header in source.glob(interface.pattern):
            text = header.read_text(encoding="utf-8")
            if header.suffix == ".in":  # the table of solvers, as CMake writes it
                table = re.findall(r"^stiction_add_solver\((\w+)", (ROOT / "cmake/solvers.cmake").read_text("utf-8"), re.M)
                text = re.sub(r"^.*@SOLVER@.*$", lambda line: "\n".join(
                    line.group().replace("@SOLVER@", name.upper()).replace("@solver@", name).replace("@number@", str(number))
                    for number, name in enumerate(table)), text, flags=re.M)
            (headers / header.name.removesuffix(".in")).write_text(text, encoding="utf-8")
        lines = [*SETTINGS, f"INPUT={headers}", f"OUTPUT_DIRECTORY={folder}", f"STRIP_FROM_PATH={headers}",
                 f"PREDEFINED={' '.join(MACROS)}", f"OPTIMIZE_OUTPUT_FOR_C={'YES' if interface.language == 'C' else 'NO'}"]
        subprocess.run(["doxygen", "-"], input="\n".join(lines), text=True, check=True, capture_output=True)
        for path in sorted(pathlib.Path(folder, "xml").glob("*.xml")):
            yield from ElementTree.parse(path).getroot().findall("compounddef")


def share_comments(members):
    """Gives the comment behind `a, b, c` of one type and line to each of them."""
    for before, after in zip(reversed(members[:-1]), reversed(members[1:])):
        same = before.kind == after.kind == "variable" and before.place[:2] == after.place[:2]
        if same and not before.is_documented:
            before.node.remove(before.node.find("briefdescription"))
            before.node.append(after.node.find("briefdescription"))


class Reference:
    """The declarations of an interface by header, in the order of the headers' lines."""

    def __init__(self, interface, source=None):
        self.interface = interface
        self.headers = {}
        self.about = {}  # header -> text of its \file comment
        self.links = {}  # Doxygen's id -> (header, anchor)
        classes = {}
        rest = []
        for compound in read_xml(interface, source or ROOT / interface.headers):
            kind = compound.get("kind")
            name = plain(compound.find("compoundname")).removeprefix("stiction::")
            if kind == "file":
                self.about[name] = compound
                self.headers.setdefault(name, [])
            members = [Item(member.get("kind"), plain(member.find("name")), member) for member in compound.iter("memberdef")
                       if member.get("prot") == "public"]
            if kind in ("class", "struct", "union") and compound.find("location").get("bodyend") != "-1" and "detail::" not in name:
                for member in members:
                    member.name = f"{name}::{member.name}"
                members.sort(key=lambda member: member.place)
                share_comments(members)
                classes[name] = Item(kind, name, compound, members)
            elif kind == "file" or (kind == "namespace" and name in ("stiction", "graph")):
                rest += members
        for name, item in classes.items():
            outer = classes.get(name.rpartition("::")[0])
            (outer.members if outer else rest).append(item)
        named = {item.name for item in rest if item.kind in ("struct", "enum")}
        seen = set()
        for item in sorted(rest, key=lambda item: item.place):
            identity = item.node.get("id")
            if identity in seen or (item.kind == "typedef" and item.name in named):
                continue
            seen.add(identity)
            if item.kind == "define" and (not item.is_documented or item.node.find("initializer") is None):
                continue
            item.members += [Item("value", f"{item.name}::{plain(value.find('name'))}", value)
                             for value in item.node.findall("enumvalue")]
            self.headers[item.place[0]].append(item)
            self._remember(item, item.place[0], item.name)

    def _remember(self, item, header, anchor):
        self.links[item.node.get("id")] = (header, anchor_of(anchor))
        for member in item.members:
            own = member.kind in ("function", "class", "struct")
            self._remember(member, header, member.name if own else anchor)

    def undocumented(self):
        """Sentences, one for each public symbol without a comment."""
        def walk(item, owner):
            if not item.is_documented and not (item.kind == "function" and is_written_by_language(item, owner)):
                line = "" if item.kind == "value" else f":{item.place[1]}"
                yield f"{self.interface.headers}/{header}{line}: {item.name} ({item.kind}) has no comment"
            for member in item.members:
                yield from walk(member, item.name.rpartition("::")[2])

        for header, items in self.headers.items():
            if not plain(self.about[header].find("detaileddescription")):
                yield f"{self.interface.headers}/{header}: a \\file comment says what it is for"
            for item in items:
                yield from walk(item, "")

    def page_of(self, header):
        return f"{self.interface.folder}/{header}.md"

    def names(self):
        """Types by name: the page below the folder, and the anchor, where each is described."""
        return {item.name: (f"{header}.html", anchor_of(item.name)) for header, items in self.headers.items()
                for item in items if item.kind in ("class", "struct", "enum", "typedef")}

    def pages(self):
        """Markdown by path."""
        found = {self.interface.index: self._index()}
        for header, items in self.headers.items():
            found[self.page_of(header)] = self._page(header, items)
        return found

    def contents(self):
        """(page, subject), the index first."""
        yield self.interface.index, f"every name of the {self.interface.language} interface, by header"
        for header in self.headers:
            about = plain(self.about[header].find("detaileddescription"))
            yield self.page_of(header), re.sub(r" \(docs/[^)]*\)", "", about).partition(". ")[0].rstrip(".")

    def _index(self):
        parts = [f"# {self.interface.language}, every name\n\n{self.interface.intro}"]
        for header, items in self.headers.items():
            page = f"{posix_name(self.interface.folder)}/{header}.md"
            names = dict.fromkeys(item.name for item in items)
            listed = ", ".join(f"[`{name}`]({page}#{anchor_of(name)})" for name in names)
            about = "".join(blocks(self.about[header], self.links, "docs", f"{posix_name(self.interface.folder)}/"))
            parts.append(f"## [{self.interface.include}{header}]({page})\n\n{about}" + (f"\n\n{listed}" if listed else ""))
        return "\n\n".join(parts) + "\n"

    def _page(self, header, items):
        source = f"{self.interface.headers}/{header}"
        source += ".in" if (ROOT / f"{source}.in").is_file() else ""
        parts = [f"# {self.interface.include}{header}", *self._text(self.about[header]),
                 f"```cpp\n#include \"{self.interface.include}{header}\"\n```" if self.interface.include
                 else f"```c\n#include <{header}>\n```", f"Source: [{source}](../../{source})"]
        return "\n\n".join(parts + self._sections(items, 2)) + "\n"

    def _text(self, node):
        return blocks(node, self.links, self.interface.folder, "")

    def _sections(self, items, level):
        parts = []
        before = None
        for item in items:
            if item.name != before:  # overloads share a heading
                short = item.name.rpartition("::")[2]  # in the list of a page, where the class stands above
                label = f' data-toc-label="{short}"' if short != item.name else ""
                parts.append(f"{'#' * level} {item.name} {{#{anchor_of(item.name)}{label}}}")
            before = item.name
            language = "c" if self.interface.language == "C" else "cpp"
            parts.append(f"```{language}\n{declaration(item)}\n```")
            parts += self._text(item.node)
            parts += self._table(item)
            shown = [member for member in item.members if member.kind in ("class", "struct", "enum") or
                     (member.kind in ("function", "typedef") and member.is_documented)]
            parts += self._sections(shown, level + 1)
        return parts

    def _table(self, item):
        """Fields of a struct or values of an enumeration."""
        rows = []
        for member in item.members:
            if member.kind not in ("variable", "value"):
                continue
            name = member.name.rpartition("::")[2]
            initial = re.sub(r"^= *", "", plain(member.node.find("initializer")))
            kind = plain(member.node.find("type"))
            kind = re.sub(r" ?([*&])", r"\1", kind).replace("< ", "<").replace(" >", ">")
            second = f" = `{initial}`" if initial and initial != "nullptr" else ""
            if member.kind == "variable":
                second = f"<br>`{kind}`{second}"
            text = " ".join(self._text(member.node)).replace("|", "&#124;").replace("\n", " ")
            rows.append(f"| **`{name}`**{second} | {text} |")
        if not rows:
            return []
        return ["\n".join([f"| {'field' if item.kind != 'enum' else 'value'} | meaning |", "|---|---|", *rows])]


def posix_name(path):
    return path.rpartition("/")[2]


def references():
    return [Reference(CPP), Reference(C)]


def self_test():
    """A header with one symbol of each kind without a comment, beside ones that have or need none."""
    planted = """#pragma once
/// \\file
/// A test.
namespace stiction {
/// Documented.
struct Good { int a, b;  ///< both
  Good(const Good&); ~Good(); bool operator==(const Good&) const = default;
 private: int hidden(); };
struct Bad { int field; void call(); };
enum class Kind { first /**< one */, second };
void function();
inline constexpr int kConstant = 1;
using Alias = int;
namespace detail { void inner(); }
class Forward;
}
"""
    expected = {"Bad", "Bad::field", "Bad::call", "Kind", "Kind::second", "function", "kConstant", "Alias"}
    with tempfile.TemporaryDirectory() as folder:
        pathlib.Path(folder, "planted.hpp").write_text(planted, encoding="utf-8")
        pathlib.Path(folder, "bare.hpp").write_text("#pragma once\n", encoding="utf-8")
        said = list(Reference(CPP, pathlib.Path(folder)).undocumented())
    found = {match[1] for line in said if (match := re.search(r": ([\w:]+) \(\w+\) has no comment", line))}
    bare = [line for line in said if "bare.hpp: a \\file comment" in line]
    print(f"self-test: {len(expected)} symbols and a header without a comment; missed: {sorted(expected - found)}, "
          f"found in vain: {sorted(found - expected)}, headers: {len(bare)}")
    return 0 if found == expected and len(bare) == 1 else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=pathlib.Path)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if shutil.which("doxygen") is None:
        print("SKIPPED: doxygen is not here (Debian's package doxygen); nothing checked")
        return SKIPPED
    if arguments.self_test:
        return self_test()
    found = references()
    for path, text in ((path, text) for reference in found for path, text in reference.pages().items() if arguments.folder):
        to = arguments.folder / path
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_text(text, encoding="utf-8")
    missing = [line for reference in found for line in reference.undocumented()]
    print("\n".join([*missing, f"{sum(len(reference.links) for reference in found)} symbols, {len(missing)} without a comment"]))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
