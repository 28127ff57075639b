#!/usr/bin/env python3
"""Checks the imports of each room of the Python package from the others.

Usage: lint_imports.py [--root DIR] [--self-test]

The table below is the package's structure: a room is a folder of python/stiction or a file there. No room imports one
that imports it, so there are no import cycles. An import that the table does not have is reported as `file:line:
sentence` and the exit status is 1. Every room may import the compiled module, `_core`.
"""

import ast
import pathlib
import sys

import lint_tools

PACKAGE = pathlib.PurePosixPath("python/stiction")
ROOMS = {
    "core": [],
    "monitor": ["core"],
    "learning": ["core"],
    "__init__": ["core", "monitor", "learning"],
    "report": ["core"],
    "distributed": ["core"],
    "testing": [],
    "torch": ["core"],
    "jax": ["core"],
    "mjx": ["core", "jax"],
    "newton": ["core"],
    "mujoco_warp": ["core"],
    "mujoco": ["core"],
    "view": ["core"],
    "envs": ["core", "distributed", "mujoco"],
    "__main__": [],
}


def imported(tree, folder):
    """(line, parts of the name below `stiction`) of every import of the package by a file of that folder."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            module = node.module.split(".") if node.module else []
            if node.level:
                base = list(folder.parts)[:len(folder.parts) - node.level + 1] + module
            elif module[:1] == ["stiction"]:
                base = module[1:]
            else:
                continue
            for name in [[]] if base else [[alias.name] for alias in node.names]:
                yield node.lineno, base + name
        elif isinstance(node, ast.Import):
            for alias in node.names:
                parts = alias.name.split(".")
                if parts[0] == "stiction" and len(parts) > 1:
                    yield node.lineno, parts[1:]


def check_file(root, path):
    """Sentences for one file; its path is relative to the package."""
    room = pathlib.PurePosixPath(path.parts[0]).stem
    if room not in ROOMS:
        return [f"{PACKAGE / path}:1: {room} is no room of the package that ROOMS of tools/lint_imports.py has"]
    tree = ast.parse((root / PACKAGE / path).read_text(encoding="utf-8"))
    allowed = [room, "_core", *ROOMS[room]]
    return [f"{PACKAGE / path}:{line}: {room} may not import {'.'.join(parts)}; it may import {', '.join(allowed[1:])}"
            for line, parts in imported(tree, path.parent) if parts and parts[0] not in allowed]


def check_tree(root):
    files = sorted(file.relative_to(root / PACKAGE) for file in (root / PACKAGE).rglob("*.py"))
    return len(files), [sentence for path in files for sentence in check_file(root, pathlib.PurePosixPath(path))]


def self_test():
    """The table has no circle; of a small tree that is clean, each planted import is found."""
    failures = []
    below = dict.fromkeys(ROOMS, False)
    while room := next((r for r, done in below.items() if not done and all(below[o] for o in ROOMS[r])), None):
        below[room] = True
    failures += [f"{room} stands in a circle, or imports a room that there is not" for room, done in below.items() if not done]
    clean = {
        "__init__.py": "from . import _core, monitor\nfrom .core.batch import Batch\n",
        "core/batch.py": "import jax\nfrom .. import _core\nfrom .arrays import take\nfrom . import streams\n",
        "monitor.py": "from .core import batch\n",
        "mjx.py": "from . import jax as own\nfrom .core.batch import Batch\n",
        "view/mujoco.py": "import mujoco\nfrom ..core.batch import Batch\nfrom .frame import Frame\n",
    }
    planted = [
        ("core/batch.py", "from ..monitor import Statistics"),
        ("core/batch.py", "from .. import monitor"),
        ("core/batch.py", "def late():\n    import stiction.view"),
        ("monitor.py", "from .view import frame"),
        ("view/mujoco.py", "from ..mujoco import BatchedSimulation"),
        ("view/mujoco.py", "from stiction.envs import TASKS"),
        ("mjx.py", "from . import torch"),
    ]
    for failure in failures:
        print(failure)
    tree = {f"{PACKAGE / path}": text for path, text in clean.items()}
    found = lint_tools.test_planted(check_tree, tree, [
        *((f"{PACKAGE / path}", line + "\n", f"{PACKAGE / path}:") for path, line in planted),
        (f"{PACKAGE}/other.py", "", "other is no room of the package")])
    return 1 if failures else found


if __name__ == "__main__":
    sys.exit(lint_tools.run_check(__doc__, check_tree, self_test))
