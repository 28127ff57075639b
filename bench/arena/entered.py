"""Answers of an outside solver, judged as all others are.

ANSWERS is a folder with solver.json ({"name", "version", "given", "machine"}) and files FAMILY/NAME@TOLERANCE.h5 for any of the
sets (answer_file.py says what is in one). Beside each may be .permuted.h5, .threads.h5 and .machines.h5, all in the set's
order. They hold the solver's answers to the environments in another order, with two threads, and on another machine.
"""

import json
import pathlib
import re

import answer_file
from bits import digest
from course import verdict
from families import Problems

NAME = re.compile(r"(?P<set>[^@]+)@(?P<goal>[0-9.e+-]+)\.h5$")


def problems_in(folder, key):
    family, _, name = key.partition("/")
    path = pathlib.Path(folder, family, f"{name}.h5")
    if not path.exists():
        raise ValueError(f"no set {key} in {folder}: `arena.py sets` writes them")
    return Problems(family, name, path)


def same_bits(path, problems, answer):
    """Returns true if the other run has the same bits; None if there is none."""
    if not path.exists():
        return None
    return digest(answer_file.read(path, problems.rows, problems.environments).reaction) == digest(answer.reaction)


def entry_of(path, key, goal, name, sets):
    problems = problems_in(sets, key)
    answer = answer_file.read(path, problems.rows, problems.environments)
    entry, _ = verdict(problems, answer, goal)
    return {"set": key, "solver": name, "tolerance": goal, **entry, "setting": None, "note": answer.note,
            "permuted_equal": same_bits(path.with_suffix(".permuted.h5"), problems, answer),
            "threads_equal": same_bits(path.with_suffix(".threads.h5"), problems, answer),
            "machines_equal": same_bits(path.with_suffix(".machines.h5"), problems, answer)}


def add(ledger, sets, folder):
    """Adds the entries of one solver to the ledger; earlier ones of that name go."""
    folder = pathlib.Path(folder)
    about = json.loads((folder / "solver.json").read_text(encoding="utf-8"))
    known = {one["name"] for one in ledger["sets"]}
    taken = {one["name"] for one in ledger["solvers"] if one["by"] != "entered"}
    if about["name"] in taken:
        raise ValueError(f"solver.json: the name '{about['name']}' is taken by an entrant of the arena")
    entries = []
    for path in sorted(folder.rglob("*.h5")):
        match = NAME.match(path.relative_to(folder).as_posix())
        if not match:
            continue
        if match["set"] not in known:
            raise ValueError(f"{path}: the ledger has no set {match['set']}")
        entries.append(entry_of(path, match["set"], float(match["goal"]), about["name"], sets))
    if not entries:
        raise ValueError(f"{folder}: no file FAMILY/NAME@TOLERANCE.h5")
    ledger["entries"] = [one for one in ledger["entries"] if one["solver"] != about["name"]] + entries
    ledger["solvers"] = [one for one in ledger["solvers"] if one["name"] != about["name"]] + [
        {"name": about["name"], "version": f"{about['version']} (times of {about.get('machine', 'an unnamed machine')})",
         "given": about.get("given", "A"), "by": "entered", "threads": True}]
