"""A hook of MkDocs: in the reference of C++ and C, code that names a type leads to it.

`extra.types` of the configuration has for each folder of pages the types by name: page and fragment.
"""

import posixpath
import re

CODE = re.compile(r"<code(?: [^>]*)?>.*?</code>", re.S)
NAME = re.compile(r"(?<![\w:#/.-])([A-Za-z_]\w+)(?![\w(]|::)")
LINKED = re.compile(r"(<a [^>]*>.*?</a>)", re.S)


def with_links(code, types, page):
    def link(match):
        where = types.get(match.group(1))
        return f'<a href="{where[0] if where[0] != page else ""}#{where[1]}">{match.group(1)}</a>' if where else match.group()

    return re.sub(r">([^<]+)<", lambda text: f">{NAME.sub(link, text.group(1))}<", code)


def on_page_content(html, page, config, **_):
    """The page's HTML, with the links."""
    folder, name = posixpath.split(page.file.dest_uri)
    types = config.extra.get("types", {}).get(folder)
    if not types:
        return html
    parts = LINKED.split(html)
    parts[::2] = [CODE.sub(lambda code: with_links(code.group(), types, name), part) for part in parts[::2]]
    return "".join(parts)
