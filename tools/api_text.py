"""Converts Doxygen's XML to Markdown and declarations."""

import pathlib
import posixpath
import re

ROOT = pathlib.Path(__file__).resolve().parent.parent
WIDTH = 76  # of a declaration on one line
PAGE = re.compile(r"\bdocs/[\w/-]+?(?:\.md)?(?=[\s,.;:)]|$)")


def plain(node):
    """The text below a node, its blanks collapsed."""
    return " ".join("".join(node.itertext()).split()) if node is not None else ""


def anchor_of(name):
    """Fragment of a name's heading."""
    return re.sub(r"[^\w-]+", "-", name).strip("-").lower()


def escaped(text):
    """Text that Markdown leaves alone."""
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace("`", "\\`").replace("*", "\\*")
    text = re.sub(r"\](\s*)\[", r"]\1\\[", text)  # two brackets in a row are a link
    return re.sub(r"(?<!\w)_|_(?!\w)", r"\\_", text)


def linked_pages(text, folder):
    """`text` with links for the pages that it names by their path, as seen from `folder`."""
    def link(match):
        found = sorted(ROOT.glob(match.group() + ("" if match.group().endswith(".md") else "*.md")))
        if not found:
            return match.group()
        path = found[0].relative_to(ROOT).as_posix()
        return f"[{posixpath.basename(path).removesuffix('.md')}]({posixpath.relpath(path, folder)})"

    return PAGE.sub(link, text)


class Writer:
    """Blocks of Markdown of one description."""

    def __init__(self, links, folder, prefix, header):
        self._links = links
        self._folder = folder
        self._prefix = prefix
        self._header = header
        self.blocks = []
        self._line = ""

    def flush(self):
        line = " ".join(self._line.split())
        line = re.sub(r"(?<![`\w])Error\(\w+\)", r"`\g<0>`", line)
        if line:
            self.blocks.append(linked_pages(line, self._folder))
        self._line = ""

    def inline(self, node):
        """One element within a line."""
        text = plain(node)
        if node.tag == "ref":
            where = self._links.get(node.get("refid"))
            if where and (self._header, where[1]) in self._links.values():  # Doxygen takes any overload
                where = (self._header, where[1])
            self._line += f"[{escaped(text)}]({self._prefix}{where[0]}.md#{where[1]})" if where else escaped(text)
        elif node.tag == "computeroutput":
            self._line += f"`{text}`"
        elif node.tag in ("bold", "emphasis"):
            self._line += f"{'**' if node.tag == 'bold' else '*'}{escaped(text)}{'**' if node.tag == 'bold' else '*'}"
        elif node.tag == "ulink":
            self._line += f"[{escaped(text)}]({node.get('url')})"
        else:
            symbols = {"ndash": "-", "mdash": "-", "nonbreakablespace": " ", "linebreak": " ", "sp": " "}
            self._line += symbols.get(node.tag, escaped(text))

    def block(self, node):
        """One element that is a block of its own; false if it is not."""
        if node.tag in ("verbatim", "preformatted", "programlisting"):
            self.flush()
            lines = ["".join(line.itertext()) if line.find(".//sp") is None else "".join(
                (part.text or "") + ("" if part.tag != "sp" else " ") + (part.tail or "") for part in line.iter())
                for line in node.iter("codeline")] if node.tag == "programlisting" else "".join(node.itertext()).split("\n")
            text = "\n".join(line.rstrip() for line in lines).strip("\n")
            self.blocks.append(f"```text\n{text}\n```")
        elif node.tag in ("itemizedlist", "orderedlist"):
            self.flush()
            self.blocks.append("\n".join(f"- {' '.join(self._apart(item))}" for item in node.findall("listitem")))
        elif node.tag == "parameterlist":
            self.flush()
            for item in node.findall("parameteritem"):
                name = plain(item.find("parameternamelist")).rstrip(".")
                text = " ".join(self._apart(item.find("parameterdescription")))
                name = f"`{name}`" if name.startswith("Error") else name
                self.blocks.append(f"**Throws** {name} {text}".strip().rstrip(".") + ".")
        elif node.tag in ("simplesect", "para"):
            self.flush()
            self.blocks += self._apart(node)
        else:
            return False
        return True

    def _apart(self, node):
        writer = Writer(self._links, self._folder, self._prefix, self._header)
        writer.read(node)
        return writer.blocks

    def read(self, node):
        self._line += escaped(node.text or "")
        for child in node:
            if not self.block(child):
                self.inline(child)
            self._line += escaped(child.tail or "")
        self.flush()


def blocks(node, links, folder, prefix):
    """A declaration's comment as blocks of Markdown for a page in `folder`; `links` lead to `prefix` and a header."""
    writer = Writer(links, folder, prefix, node.find("location").get("file") if node.find("location") is not None else "")
    for part in ("briefdescription", "detaileddescription"):
        if node.find(part) is not None:
            writer.read(node.find(part))
    return writer.blocks


def tidy(text):
    """C++ as the project writes it, of Doxygen's spacing."""
    text = re.sub(r"< +", "<", text)
    text = re.sub(r" +>", ">", text)
    text = re.sub(r" *([&*]+) *(?=[\w.)>,]|$)", lambda match: match.group(1) + " ", text)
    text = re.sub(r"([&*]) (?=[)>,]|$)", r"\1", text)
    text = re.sub(r"(\w)=(?=[\w{\"-])", r"\1 = ", text)
    return re.sub(r"\s+", " ", text).strip()


def split_arguments(text):
    """`a, b<c, d>` at the commas outside brackets."""
    found, depth, begin = [], 0, 0
    for at, letter in enumerate(text):
        depth += {"(": 1, "<": 1, "{": 1, "[": 1, ")": -1, ">": -1, "}": -1, "]": -1}.get(letter, 0)
        if letter == "," and depth == 0:
            found.append(text[begin:at].strip())
            begin = at + 1
    return [*found, text[begin:].strip()]


def function_text(node, name):
    head = f"{tidy(plain(node.find('type')))} {name}".strip()
    head = re.sub(r"^(static|explicit) ", "", head)
    for word in ("static", "explicit"):
        head = f"{word} {head}" if node.get(word) == "yes" else head
    arguments = plain(node.find("argsstring"))
    close = arguments.rfind(")")
    inner, after = tidy(arguments[1:close]), arguments[close + 1:].strip()
    after = f" {after}" if after else ""
    line = f"{head}({inner}){after};"
    if len(line) <= WIDTH:
        return line
    return f"{head}(\n    " + ",\n    ".join(split_arguments(inner)) + f"){after};"


def declaration(item):
    """The declaration of an item, without its members."""
    node, name = item.node, item.name.rpartition("::")[2]
    parameters = node.find("templateparamlist")
    template = ""
    if parameters is not None:
        listed = ", ".join(f"{tidy(plain(p.find('type')))} {plain(p.find('declname'))}".strip() for p in parameters.findall("param"))
        template = f"template <{listed}>\n"
    if item.kind == "function":
        return template + function_text(node, name)
    if item.kind == "enum":
        below = plain(node.find("type"))
        return f"enum {'class ' if node.get('strong') == 'yes' else ''}{name}{f' : {below}' if below else ''};"
    if item.kind in ("class", "struct", "union"):
        bases = ", ".join(f"{base.get('prot')} {tidy(plain(base))}" for base in node.findall("basecompoundref"))
        return f"{template}{item.kind} {name}{f' : {bases}' if bases else ''};"
    if item.kind == "typedef":
        kind = tidy(plain(node.find("type")))
        return f"using {name} = {kind};" if "using" in plain(node.find("definition")) else f"typedef {kind} {name};"
    if item.kind == "define":
        return f"#define {name} {plain(node.find('initializer'))}"
    return f"{tidy(plain(node.find('type')))} {name} {plain(node.find('initializer'))}".strip() + ";"
