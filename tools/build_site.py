#!/usr/bin/env python3
"""Builds the documentation's site from the Markdown of the checkout, and fails on a link that leads nowhere.

Every page keeps its path. A link to a source file leads to a page that shows it. A link to a folder leads to its
README or a list of its files. The navigation is docs/index.md's: its sections and their tables, on the left of every
page. A formula (a fence of language math, as GitHub has it) becomes MathML, which browsers draw by themselves. Beside
each page lies its Markdown, and llms.txt lists them. The Python package's interface is written out from its docstrings, those of C++ and
C from the comments of their headers (tools/api_reference.py).

    tools/build_site.py FOLDER [--stage FOLDER]      the site; the pages it is built from (default: FOLDER-pages)

Needs the packages of tools/requirements-site.txt, and doxygen.
"""

import argparse
import html.parser
import json
import os
import pathlib
import posixpath
import re
import shutil
import subprocess
import sys
import urllib.parse

import api_reference
import griffe
import latex2mathml.converter
import yaml

ROOT = pathlib.Path(__file__).resolve().parent.parent
LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s]+)(\))")
CODE = re.compile(r"^ {0,3}```.*?^ {0,3}```|^(?: {4}|\t)[^\n]*$|`(?:[^`\n]|\n(?!\s*\n))+`", re.M | re.S)
LANGUAGES = {".hpp": "cpp", ".cpp": "cpp", ".cu": "cpp", ".cuh": "cpp", ".h": "c", ".c": "c", ".py": "python",
             ".sh": "bash", ".cmake": "cmake", ".csv": "text", ".json": "json", ".txt": "text", ".toml": "toml"}
HIDDEN = "---\nsearch:\n  exclude: true\n---\n\n"
FIRST = "---\nsearch:\n  boost: 8\n---\n\n"  # a name is looked for where it is described
API = "docs/python_api.md"
ARENA = ("bench/arena/page.py", "bench/results/amd-epyc-2-cores/arena.json")  # program of the leaderboard, and input
FORMULA = re.compile(r"^ {0,3}```math\n(.*?)^ {0,3}```$", re.M | re.S)
TAG = re.compile(r"\\tag\{([^}]*)\}")
PAGE_NAME = re.compile(r"[\w./-]+\.md")
STYLE = """
.formula { display: flex; align-items: center; overflow-x: auto; margin: 1em 0; }
.formula math { margin: 0 auto; }
.md-typeset td:first-child code { word-break: normal; }
@media screen and (max-width: 44.984375em) {
  .md-typeset table:not([class]) { font-size: .58rem; }
  .md-typeset table:not([class]) :is(td, th) { min-width: 0; padding: .5em .6em; }
  .md-typeset table:not([class]) td code { font-size: .95em; padding: 0 .1em; }
  .md-typeset table:not([class]) td:not(:first-child) code { word-break: break-word; }
}
"""  # tables of a few columns fit a phone, and names of fields stay whole; wider ones scroll


def tracked(pattern):
    """Files below a folder, or of a pattern, that are the project's; without git, all outside hidden and build folders."""
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-co", "--exclude-standard", pattern], capture_output=True,
                            text=True, check=False)
    if listed.returncode == 0:
        return listed.stdout.splitlines()
    found = []
    for path in sorted((ROOT / pattern).rglob("*") if (ROOT / pattern).is_dir() else ROOT.rglob(pattern.rpartition("/")[2])):
        name = path.relative_to(ROOT).as_posix()
        if path.is_file() and not re.match(r"(build|out)[^/]*/|\.", name) and name.startswith(pattern.rpartition("/")[0]):
            found.append(name)
    return found


class Stage:
    """The pages, as MkDocs reads them: Markdown of the checkout with its links turned to pages of the site."""

    def __init__(self, folder):
        self._folder = folder
        self._shown = set()

    def write(self, path, text):
        to = self._folder / path
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_text(text, encoding="utf-8")

    def page(self, path):
        self.put(path, (ROOT / path).read_text(encoding="utf-8"))

    def put(self, path, text):
        """Stages a page with `text`."""
        code = [match.span() for match in CODE.finditer(text)]

        def turned(match):
            if any(begin <= match.start() < end for begin, end in code):
                return match.group()
            target = self._target(path, match.group(2))
            return f"{self._named(path, match.group(1), match.group(2))}{target}{match.group(3)}"

        self.write(path, FORMULA.sub(lambda match: formula(match.group(1)), LINK.sub(turned, text)))

    @staticmethod
    def _named(page, opening, target):
        """The link's text. The name of a page's file becomes the page's title."""
        there = posixpath.normpath(posixpath.join(posixpath.dirname(page), target.partition("#")[0]))
        if PAGE_NAME.fullmatch(opening[1:-2]) and there.endswith(".md") and (ROOT / there).is_file():
            return f"[{title_of(there)}]("
        return opening

    def _target(self, page, target):
        """The link's target as the site has it; its page is staged."""
        if re.match(r"[a-z]+:|#", target):
            return target
        path, _, fragment = target.partition("#")
        there = posixpath.normpath(posixpath.join(posixpath.dirname(page), path))
        if (ROOT / there).is_dir():
            there = self._folder_page(there)
        elif not there.endswith(".md") and (ROOT / there).is_file():
            there = self._file_page(there)
        relative = posixpath.relpath(there, posixpath.dirname(page) or ".")
        return f"{relative}#{fragment}" if fragment else relative

    def _folder_page(self, folder):
        readme = posixpath.join(folder, "README.md")
        if (ROOT / readme).is_file():
            return readme
        if readme not in self._shown:
            self._shown.add(readme)
            names = sorted(name for name in tracked(folder) if "/" not in name[len(folder) + 1:])
            rows = "\n".join(f"- [{title_of(name) if name.endswith('.md') else posixpath.basename(name)}]"
                             f"({posixpath.basename(self._linked(name))})" for name in names)
            self.write(readme, f"{HIDDEN}# {folder}\n\n{rows}\n")
        return readme

    def _linked(self, name):
        return name if name.endswith(".md") else self._file_page(name)

    def _file_page(self, name):
        """An image or a table stays a file; text becomes a page that shows it."""
        source = ROOT / name
        suffix = pathlib.PurePath(name.removesuffix(".in")).suffix  # a template is shown as its result
        language = LANGUAGES.get(suffix, "text" if not suffix else None)
        if language is None:
            to = self._folder / name
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, to)
            return name
        page = f"{name}.md"
        if page not in self._shown:
            self._shown.add(page)
            text = source.read_text(encoding="utf-8")
            fence = "`" * max(3, 1 + max((len(run) for run in re.findall(r"`+", text)), default=0))
            self.write(page, f"{HIDDEN}# {name}\n\n{fence}{language}\n{text}{fence}\n")
        return page


def sections():
    """docs/index.md as (heading, [(title, path, description)])."""
    text = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    found = []
    for part in re.split(r"^## ", text, flags=re.M)[1:]:
        heading, _, body = part.partition("\n")
        rows = []
        for row in re.findall(r"^\| (\[.*?) \| (.*) \|$", body, re.M):
            for title, target in re.findall(r"\[([^\]]+)\]\(([^)]+)\)", row[0]):
                path = posixpath.normpath(posixpath.join("docs", target.partition("#")[0]))
                rows.append((title, path, row[1]))
        if rows:
            found.append((heading.strip(), rows))
    return found


def formula(latex):
    """HTML of a formula, with its number on the right."""
    number = TAG.search(latex)
    mathml = latex2mathml.converter.convert(TAG.sub("", latex).strip(), display="block")
    if "\\" in mathml or re.search(r">&(amp;)?<", mathml):
        raise ValueError(f"a command of LaTeX that latex2mathml does not know: {latex}")
    return f'<div class="formula">{mathml}{f"<span>({number.group(1)})</span>" if number else ""}</div>'


def title_of(path):
    match = re.search(r"^# (.+)$", (ROOT / path).read_text(encoding="utf-8"), re.M)
    return re.sub(r"`", "", match.group(1)) if match else path


def arena_page(stage, folder):
    """The leaderboard beside its page, which gets a link to it."""
    (folder / "bench/arena").mkdir(parents=True, exist_ok=True)
    program, ledger = (ROOT / path for path in ARENA)
    subprocess.run([sys.executable, program, ledger, folder / "bench/arena/leaderboard.html"], check=True)
    text = (ROOT / "bench/arena/README.md").read_text(encoding="utf-8")
    title, _, rest = text.partition("\n")
    stage.put("bench/arena/README.md", f"{title}\n\n**[Open the leaderboard](leaderboard.html).**\n{rest}")


def headers_of(reference):
    """Navigation of an interface's pages."""
    interface = reference.interface
    pages = [{f"{interface.include}{header}": reference.page_of(header)} for header in reference.headers]
    return {f"{interface.language}, every name": [{"By header": interface.index}, *pages]}


def navigation(references):
    nav = [{"Home": "README.md"}, {"All pages": "docs/index.md"}]
    for heading, rows in sections():
        pages = []
        for title, path, _ in rows:
            if (ROOT / path).is_dir():
                pages.append({title: [
                    {title_of(page): page} for page in sorted(tracked(f"{path}/*.md"))
                    if page.count("/") == path.count("/") + 1 and "NNNN" not in page]})
            elif {title: path} not in pages:
                pages.append({title: path})
        if heading == "Reference":
            pages = [{"Python, every name": API}, *map(headers_of, references), *pages]
        nav.append({heading: pages})
    return nav


def modules():
    """The modules of the package that a user imports."""
    package = ROOT / "python" / "stiction"
    found = [path.stem for path in package.glob("*.py")] + [path.parent.name for path in package.glob("*/__init__.py")]
    return ["stiction"] + sorted(f"stiction.{name}" for name in found if not name.startswith("_"))


def undocumented():
    """Public classes, functions, methods and properties without a docstring."""
    package = griffe.load("stiction", search_paths=[ROOT / "python"], resolve_aliases=True)

    def walk(holder, path):
        for name, member in holder.members.items():
            if name.startswith("_") or (member.is_alias and (holder.is_module and name not in (holder.exports or []))):
                continue
            here = f"{path}.{name}"
            try:
                is_named = member.is_class or member.is_function or (member.is_attribute and "property" in member.labels)
                if is_named and not member.has_docstring:
                    yield here
                if member.is_class:
                    yield from walk(member, here)
            except griffe.AliasResolutionError:  # from the compiled module
                continue

    for name in modules():
        yield from walk(package if name == "stiction" else package[name.partition(".")[2]], name)


def api_page():
    """One directive for each module."""
    parts = [f"## {name}\n\n::: {name}\n    options:\n      heading_level: 3\n" for name in modules()]
    return "# The Python package, every name\n\nWith examples: [Python](reference/python.md).\n\n" + "\n".join(parts)


def configuration(stage, site, references):
    return {
        "site_name": "stiction", "docs_dir": str(stage), "site_dir": str(site), "use_directory_urls": False,
        "site_description": "A library of contact solvers for thousands of simulated robots at once",
        "theme": {"name": "material", "font": False, "features": ["navigation.top", "content.code.copy", "search.highlight",
                                                                 "toc.follow"],
                  "palette": [{"media": "(prefers-color-scheme: light)", "scheme": "default"},
                              {"media": "(prefers-color-scheme: dark)", "scheme": "slate"}]},
        # Words end where C++ and Python end names: "solve" finds Solver::solve.
        "plugins": [{"search": {"separator": r"[\s\-,:!=\[\]()\"`/.&;<>*]+"}}, {"mkdocstrings": {"handlers": {"python": {
            "paths": [str(ROOT / "python")], "options": {"show_source": False, "docstring_style": "google",
                                                         "show_if_no_docstring": False, "members_order": "source"}}}}}],
        "extra_css": ["site.css"],
        "hooks": [str(ROOT / "tools/site_links.py")],
        "extra": {"types": {reference.interface.folder: reference.names() for reference in references}},
        "markdown_extensions": ["attr_list", "tables", "fenced_code", {"toc": {"permalink": True, "slugify": "SLUGIFY"}},
                                "pymdownx.highlight", "pymdownx.superfences"],
        "validation": {"omitted_files": "ignore", "not_found": "warn", "anchors": "warn", "unrecognized_links": "warn",
                       "absolute_links": "warn"},
        "nav": navigation(references),
    }


class Page(html.parser.HTMLParser):
    """Links and fragments of a page of the site."""

    def __init__(self, path):
        super().__init__()
        self.links, self.fragments = set(), {""}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.fragments |= {attributes.get("id"), attributes.get("name")}
        self.links |= {attributes.get("href"), attributes.get("src")} - {None}


def broken_links(site):
    """Sentences, one for each link within the site that leads nowhere."""
    pages = {path: Page(path) for path in site.rglob("*.html") if path.name != "404.html"}
    for path, page in pages.items():
        for link in sorted(page.links):
            target, _, fragment = urllib.parse.unquote(link).partition("#")
            if re.match(r"[a-z]+:|//|/", target):
                continue
            to = (path.parent / target.partition("?")[0]).resolve() if target else path
            if not to.exists():
                yield f"{path.relative_to(site)}: {link} does not exist"
            elif fragment not in (pages[to].fragments if to in pages else {fragment}) and not fragment.startswith("__"):
                yield f"{path.relative_to(site)}: {link}: the page has no such place"


def unfound(site, references):
    """Types that the search of the site has no page for."""
    found = {entry["title"] for entry in json.loads((site / "search/search_index.json").read_text("utf-8"))["docs"]}
    return [name for reference in references for name in reference.names() if name not in found]


def write_lists(site, references):
    """llms.txt, and each page's Markdown beside it."""
    lines = ["# stiction", "", "> A library of contact solvers: thousands of simulated robots at once, the same bits on "
             "every machine.", ""]
    for heading, rows in sections():
        lines += [f"## {heading}", ""]
        for title, path, holds in rows:
            if path.endswith(".md"):
                lines.append(f"- [{title}]({path}): {re.sub(r'[`*]', '', holds)}")
        if heading == "Reference":
            for reference in references:
                lines += [f"- [{path}]({path}): {what}" for path, what in reference.contents()]
        lines.append("")
    (site / "llms.txt").write_text("\n".join(lines), encoding="utf-8")
    for path in tracked("*.md"):
        if (site / path).parent.is_dir():
            shutil.copyfile(ROOT / path, site / path)
    for path, text in ((path, text) for reference in references for path, text in reference.pages().items()):
        (site / path).write_text(text, encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", type=pathlib.Path, metavar="FOLDER")
    parser.add_argument("--stage", type=pathlib.Path)
    arguments = parser.parse_args()
    site = arguments.site.resolve()
    folder = (arguments.stage or site.with_name(site.name + "-pages")).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    pages = folder / "pages"
    stage = Stage(pages)
    for path in tracked("*.md"):
        stage.page(path)
    arena_page(stage, pages)
    stage.write(API, api_page())
    stage.write("site.css", STYLE)
    references = api_reference.references()
    for path, text in ((path, text) for reference in references for path, text in reference.pages().items()):
        stage.put(path, FIRST + text)
    config = folder / "mkdocs.yml"
    text = yaml.safe_dump(configuration(pages, site, references), sort_keys=False, allow_unicode=True)
    config.write_text(text.replace("SLUGIFY", "!!python/object/apply:pymdownx.slugs.slugify\n      kwds:\n        case: lower"), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python"), "NO_MKDOCS_2_WARNING": "1"}
    # Not --quiet: it silences the warnings that --strict counts.
    built = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "--clean", "-f", str(config)],
                           env=environment, check=False, capture_output=True, text=True)
    problems = [f"{name} has no docstring" for name in undocumented()]
    problems += [line for reference in references for line in reference.undocumented()]
    if built.returncode != 0:
        problems += [line for line in built.stderr.splitlines() if not line.startswith("INFO")]
    else:
        write_lists(site, references)
        problems += broken_links(site)
        problems += [f"{name} is not found by the search" for name in unfound(site, references)]
    if problems:
        print("\n".join(problems))
    code = built.returncode or (1 if problems else 0)
    if code == 0:
        print(f"{len(list(site.rglob('*.html')))} pages in {site}")
    return code


if __name__ == "__main__":
    sys.exit(main())
