#!/usr/bin/env python3
"""The arena: contact solvers on the same problems, by one judge. bench/arena/README.md is its page.

    bench/arena/arena.py run build/bin/stiction --json FILE [--page HTML] [--quick] [--data FOLDER] [--seed S]
                             [--tolerances 1e-4,1e-6,1e-8] [--sets PATTERN] [--solvers PATTERN] [--environments N] [--seconds T]
    bench/arena/arena.py sets build/bin/stiction FOLDER       writes the problems as files, for a solver from outside
    bench/arena/arena.py judge SETS ANSWERS --json FILE       judges its answers, adds them to the JSON
    bench/arena/arena.py join FILE FILE --json FILE           one run from two parts, made with --sets or --solvers
    bench/arena/arena.py compare FILE FILE --json FILE        the first run, with whether another machine found the same bits
    bench/arena/arena.py page FILE HTML                       makes the page from the JSON
    bench/arena/arena.py check FILE                           whether the JSON is one

Entrants that are not installed are named and left out. Families that are not there are named aloud and left out. Times
are processor time of one thread. Nothing asserts one.
"""

import argparse
import datetime
import pathlib
import re
import secrets
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import entered  # noqa: E402
import families  # noqa: E402
import ledger  # noqa: E402
import measure  # noqa: E402
import others  # noqa: E402
import ours  # noqa: E402
import page  # noqa: E402
from course import Course  # noqa: E402
from machine import processor, versions  # noqa: E402

QUICK_SOLVERS = r"stiction (auto|npgs|lemke)$|Clarabel|Siconos (nsgs|lemke)|MuJoCo Newton|Pinocchio ADMM"
BEFORE = "no answer at a larger tolerance, not asked for at this one"
QUICK = {"tolerances": "1e-4,1e-8", "solvers": QUICK_SOLVERS, "environments": 3, "seconds": 0.5}
USUAL = {"tolerances": "1e-4,1e-6,1e-8", "solvers": ".", "environments": 8, "seconds": 1.0}


def prepared(candidates, wanted, folder):
    """(entrants that can run, [{name, reason}] of those that cannot)."""
    clock, ready, absent = measure.processor_clock(folder) or None, [], []
    clock = {**measure.os.environ, **clock} if clock else None
    for entrant in candidates:
        if not re.search(wanted, entrant.name):
            continue
        reason = entrant.prepare(folder, clock)
        if reason:
            absent.append({"name": entrant.name, "reason": reason})
            families.say(f"ABSENT {entrant.name}: {reason}")
        else:
            ready.append(entrant)
    return ready, absent


def describe(problems):
    return {"name": problems.key, "family": problems.family, "law": problems.laws, "environments": problems.environments,
            "rows": problems.rows, "cones": len(problems.kinds), "largest": problems.largest}


def run(arguments):
    for name, value in (QUICK if arguments.quick else USUAL).items():
        if getattr(arguments, name) is None:
            setattr(arguments, name, value)
    seed = secrets.randbelow(10**6) + 1000 if arguments.seed is None else arguments.seed
    families.say(f"seed of the hidden family: {seed}")
    goals = [float(word) for word in arguments.tolerances.split(",")]
    found = {"schema_version": ledger.VERSION, "command": "bench/arena/arena.py " + " ".join(map(str, arguments.words)),
             "machine": measure.machine_name(), "processor": processor(), "versions": versions(),
             "date": datetime.date.today().isoformat(), "seed": seed, "tolerances": goals, "seconds": arguments.seconds,
             "sets": [], "solvers": [], "absent": [], "refusals": [], "entries": []}
    with tempfile.TemporaryDirectory() as folder:
        entrants, found["absent"] = prepared([*ours.entrants(arguments.stiction), *others.entrants()], arguments.solvers, folder)
        found["absent"] += [{"name": name, "reason": reason} for name, reason in others.OUTSIDE.items()]
        found["solvers"] = [{"name": e.name, "version": e.version, "given": e.given, "threads": e.has_threads,
                             "by": "stiction" if isinstance(e, ours.Stiction) else "peer"} for e in entrants]
        sets = families.Sets(arguments.stiction, pathlib.Path(folder, "sets"), arguments.environments)
        for problems in sets.all(arguments.data, seed, arguments.quick):
            if not re.search(arguments.sets, problems.key):
                continue
            found["sets"].append(describe(problems))
            for entrant in entrants:
                compete(entrant, problems, goals, arguments.seconds, folder, found)
            if arguments.json:
                ledger.write(arguments.json, found)
    finish(arguments, found)


def compete(entrant, problems, goals, seconds, folder, found):
    reason = entrant.refuses(problems)
    if problems.is_boxed and not entrant.takes_boxes and not reason:
        reason = "boxed friction is not its law"
    if reason:
        own = next((r for r in found["refusals"] if (r["solver"], r["reason"]) == (entrant.name, reason)), None)
        if own is None:
            own = {"solver": entrant.name, "reason": reason, "sets": []}
            found["refusals"].append(own)
        own["sets"].append(problems.key)
        return
    course = Course(entrant, problems, seconds, folder)
    entry = None
    for goal in sorted(goals, reverse=True):
        entry = {**entry, "tolerance": goal, "note": BEFORE} if course.is_late else course.run(goal)
        found["entries"].append(entry)
        families.say(f"{entry['set']:32} {entry['solver']:22} {goal:g}: {entry['solved']}/{problems.environments} solved, "
                     f"{entry['us']} us, {entry['false_claims']} false claims, permuted {entry['permuted_equal']}, "
                     f"threads {entry['threads_equal']}, machines {entry['machines_equal']} {entry['note']}")


def finish(arguments, found):
    wrong = ledger.check(found)
    if wrong:
        sys.exit("arena.py: " + "; ".join(wrong[:5]))
    ledger.write(arguments.json, found)
    if arguments.page:
        page.write(arguments.page, found)


def sets(arguments):
    seed = secrets.randbelow(10**6) + 1000 if arguments.seed is None else arguments.seed
    families.say(f"seed of the hidden family: {seed}")
    made = families.Sets(arguments.stiction, arguments.folder, arguments.environments or USUAL["environments"])
    for problems in made.all(arguments.data, seed, arguments.quick):
        print(f"{problems.key}: {problems.environments} environments, {problems.rows} rows, law {problems.law}")


def judge(arguments):
    found = ledger.read(arguments.json)
    entered.add(found, arguments.sets_folder, arguments.answers)
    finish(arguments, found)


def join(arguments):
    finish(arguments, ledger.join(ledger.read(arguments.first), ledger.read(arguments.second)))


def compare(arguments):
    found, compared = ledger.compare(ledger.read(arguments.first), ledger.read(arguments.second))
    print(f"{compared} entries compared")
    finish(arguments, found)


def check(arguments):
    found = ledger.read(arguments.json)
    print(f"{arguments.json}: {len(found['entries'])} entries of {len(found['solvers'])} solvers on {len(found['sets'])} sets")


def parse(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name, does in (("run", run), ("sets", sets)):
        one = commands.add_parser(name)
        one.set_defaults(does=does)
        one.add_argument("stiction", help="the command line")
        one.add_argument("--data", type=pathlib.Path, default=measure.ROOT.parent / "shared" / "data",
                         help="folder of recorded families")
        one.add_argument("--seed", type=int, help="of the hidden family; default: drawn, and printed")
        one.add_argument("--environments", type=int, help="most of a set, evenly spread")
        one.add_argument("--quick", action="store_true", help="a minute: few sets, solvers and environments")
        if name == "sets":
            one.add_argument("folder", type=pathlib.Path)
            continue
        one.add_argument("--json", type=pathlib.Path, required=True)
        one.add_argument("--page", type=pathlib.Path)
        one.add_argument("--tolerances")
        one.add_argument("--sets", default=".", help="pattern of FAMILY/NAME")
        one.add_argument("--solvers", help="pattern of names")
        one.add_argument("--seconds", type=float, help="for an environment")
    one = commands.add_parser("judge")
    one.set_defaults(does=judge)
    one.add_argument("sets_folder", type=pathlib.Path)
    one.add_argument("answers", type=pathlib.Path)
    one.add_argument("--json", type=pathlib.Path, required=True)
    one.add_argument("--page", type=pathlib.Path)
    for name, does in (("join", join), ("compare", compare)):
        one = commands.add_parser(name)
        one.set_defaults(does=does)
        one.add_argument("first", type=pathlib.Path)
        one.add_argument("second", type=pathlib.Path)
        one.add_argument("--json", type=pathlib.Path, required=True)
        one.add_argument("--page", type=pathlib.Path)
    one = commands.add_parser("page")
    one.set_defaults(does=lambda arguments: page.write(arguments.html, ledger.read(arguments.json)))
    one.add_argument("json", type=pathlib.Path)
    one.add_argument("html", type=pathlib.Path)
    one = commands.add_parser("check")
    one.set_defaults(does=check)
    one.add_argument("json", type=pathlib.Path)
    arguments = parser.parse_args(words)
    arguments.words = words
    return arguments


def main(words=None):
    arguments = parse(sys.argv[1:] if words is None else words)
    arguments.does(arguments)


if __name__ == "__main__":
    main()
