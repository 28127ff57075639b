#!/usr/bin/env python3
"""One static page of a ledger: page.html with page.css, page.js and the data put in. Nothing is loaded from elsewhere.

    bench/arena/page.py JSON HTML       as `arena.py page`, with the standard library alone
"""

import html
import json
import pathlib
import sys

from ledger import packed, read

HERE = pathlib.Path(__file__).resolve().parent


def embedded(data):
    """JSON that can stand inside a script element."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def cells(words, tag="td"):
    return "<tr>" + "".join(f"<{tag}>{html.escape(str(word))}</{tag}>" for word in words) + "</tr>"


def about(ledger):
    """Rows that describe the machine and the program of the run."""
    versions = ", ".join(f"{name} {value}" for name, value in ledger["versions"].items())
    rows = [("made", f"{ledger['date']}, by {ledger['command']}"), ("machine", f"{ledger['machine']}: {ledger['processor']}"),
            ("seed of the hidden family", ledger["seed"]),
            ("processor seconds for an environment", f"{ledger['seconds']:g}"), ("versions", versions)]
    return "".join(cells(row) for row in rows)


def solvers(ledger):
    return "".join(cells((one["name"], one["version"], one["given"], one["by"])) for one in ledger["solvers"])


def refusals(ledger):
    rows = [cells((one["solver"], one["reason"], ", ".join(one["sets"]))) for one in ledger["refusals"]]
    return "".join(rows) or cells(("none", "", ""))


def absent(ledger):
    return "".join(cells((one["name"], one["reason"])) for one in ledger["absent"])


def text(ledger):
    page = (HERE / "page.html").read_text(encoding="utf-8")
    parts = {"STYLE": (HERE / "page.css").read_text(encoding="utf-8"), "PROGRAM": (HERE / "page.js").read_text(encoding="utf-8"),
             "ABOUT": about(ledger), "SOLVERS": solvers(ledger), "REFUSALS": refusals(ledger), "ABSENT": absent(ledger),
             "DATA": embedded(packed(ledger))}
    for name, value in parts.items():  # the data come last: nothing in them is a name of a part
        page = page.replace(f"<!--{name}-->", value)
    return page


def write(path, ledger):
    pathlib.Path(path).parent.mkdir(parents=True, exist_ok=True)
    pathlib.Path(path).write_text(text(ledger), encoding="utf-8")


if __name__ == "__main__":
    write(sys.argv[2], read(sys.argv[1]))
