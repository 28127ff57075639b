#!/usr/bin/env python3
"""Names that the shared library exports, its header declares and the committed list has must be the same.

Usage: check_symbols.py --nm=NM --header=stiction.h --list=exported_symbols.map libstiction.so
"""

import argparse
import pathlib
import re
import subprocess
import sys


def exported(nm, library):
    """Dynamic symbols that are defined, without the version's own."""
    lines = subprocess.run([nm, "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    names = [line.split() for line in lines.splitlines()]
    return {fields[-1].split("@")[0] for fields in names if fields and fields[-2] != "A"}


def declared(header):
    text = re.sub(r"/\*.*?\*/", "", pathlib.Path(header).read_text(encoding="utf-8"), flags=re.S)
    return set(re.findall(r"STICTION_API[^;]*?\b(stiction_\w+)\(", text))


def listed(path):
    text = re.sub(r"#.*", "", pathlib.Path(path).read_text(encoding="utf-8"))
    body = re.search(r"global:(.*?)local:", text, flags=re.S).group(1)
    return set(body.replace(";", " ").split())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--nm", default="nm")
    parser.add_argument("--header", required=True)
    parser.add_argument("--list", required=True)
    parser.add_argument("library")
    arguments = parser.parse_args()
    names = listed(arguments.list)
    wrong = 0
    for what, found in (("header", declared(arguments.header)), ("library", exported(arguments.nm, arguments.library))):
        for name in sorted(found - names):
            print(f"{name}: in the {what}, not in the list")
        for name in sorted(names - found):
            print(f"{name}: in the list, not in the {what}")
        wrong += len(found ^ names)
    print(f"{len(names)} symbols, {wrong} differences")
    return 1 if wrong or not names else 0


if __name__ == "__main__":
    sys.exit(main())
