"""The arena's JSON: its contents, and a check that a file is such.

    schema_version   1
    command, machine, processor, versions, date, seed     what made it, and where
    tolerances       list of numbers
    seconds          of processor time that a peer may take for an environment, stiction for one times their number
    sets             name, family, law (either: no friction), environments, rows, cones, largest (rows of one environment)
    solvers          name, version, given (what it reads: A, or J and M), by (stiction, peer or entered), threads
    absent           name, reason: entrants that are not installed, or that the arena cannot call
    refusals         solver, reason, sets: those sets are no problems of that solver
    entry_columns    names of an entry's values, in order
    entries          one a run and a line: the list of those values. `read` makes objects of them

An entry has

    set, solver, tolerance
    setting          the tightest that an answer came from: a tolerance, or a number of iterations
    us               microseconds of processor time an environment, null where it is not known; never asserted
    residual_max, residual_p95    by the judge, over environments; null: not finite
    solved           environments whose residual is within 1.02 of the tolerance
    claimed          environments that the solver calls solved; null where it says nothing
    false_claims     of those, the ones that the judge does not accept
    iterations       median; null where it is not told
    memory_mib       peak of the process over its idle state; null where it was not measured
    hash             of all reactions' bits
    permuted_equal   the hash after solving the environments in another order; null: one environment, or out of time
    threads_equal    the hash with 2 threads; null: the solver has no such setting, or out of time
    machines_equal   the hash with the code that libraries have for an older processor (machine.py), and that of every machine
                     that was compared; null: neither, or out of time
    note             why there is no answer, or none of some environments
"""

import json
import pathlib

VERSION = 1
NUMBER, TEXT, TRUTH, COUNT = (int, float), (str,), (bool,), (int,)
NOTHING = (type(None),)
TOP = {"schema_version": COUNT, "command": TEXT, "machine": TEXT, "processor": TEXT, "versions": (dict,), "date": TEXT,
       "seed": COUNT,
       "tolerances": (list,), "seconds": NUMBER, "sets": (list,), "solvers": (list,), "absent": (list,), "refusals": (list,),
       "entries": (list,)}
SET = {"name": TEXT, "family": TEXT, "law": TEXT, "environments": COUNT, "rows": COUNT, "cones": COUNT, "largest": COUNT}
SOLVER = {"name": TEXT, "version": TEXT, "given": TEXT, "by": TEXT, "threads": TRUTH}
ABSENT = {"name": TEXT, "reason": TEXT}
REFUSAL = {"solver": TEXT, "reason": TEXT, "sets": (list,)}
# In the order of the file's columns.
ENTRY = {"set": TEXT, "solver": TEXT, "tolerance": NUMBER, "setting": NUMBER + NOTHING, "us": NUMBER + NOTHING,
         "residual_max": NUMBER + NOTHING, "residual_p95": NUMBER + NOTHING, "solved": COUNT, "claimed": COUNT + NOTHING,
         "false_claims": COUNT + NOTHING, "iterations": COUNT + NOTHING, "memory_mib": NUMBER + NOTHING, "hash": TEXT,
         "permuted_equal": TRUTH + NOTHING, "threads_equal": TRUTH + NOTHING, "machines_equal": TRUTH + NOTHING, "note": TEXT}


def problems_of(where, item, fields):
    """Sentences about one object."""
    if not isinstance(item, dict):
        return [f"{where} is no object"]
    found = [f"{where}: '{name}' is missing" for name in fields if name not in item]
    found += [f"{where}: '{name}' is not known" for name in item if name not in fields]
    for name, kinds in fields.items():
        value = item.get(name)
        is_truth = isinstance(value, bool)
        if name in item and (not isinstance(value, kinds) or (is_truth and bool not in kinds)):
            found.append(f"{where}: '{name}' is {value!r}")
    return found


def check(ledger):
    """Sentences, one for each thing that is wrong; none: the file is sound."""
    found = problems_of("the ledger", ledger, TOP)
    if found:
        return found
    if ledger["schema_version"] != VERSION:
        return [f"schema_version is {ledger['schema_version']}, expected {VERSION}"]
    for part, fields in (("sets", SET), ("solvers", SOLVER), ("absent", ABSENT), ("refusals", REFUSAL), ("entries", ENTRY)):
        for number, item in enumerate(ledger[part]):
            found += problems_of(f"{part}[{number}]", item, fields)
    if found:
        return found
    sizes = {one["name"]: one["environments"] for one in ledger["sets"]}
    solvers = {one["name"] for one in ledger["solvers"]}
    seen = set()
    for number, entry in enumerate(ledger["entries"]):
        where, key = f"entries[{number}]", (entry["set"], entry["solver"], entry["tolerance"])
        if entry["set"] not in sizes or entry["solver"] not in solvers:
            found.append(f"{where}: set or solver is not in the lists")
            continue
        if key in seen:
            found.append(f"{where}: {key} is there twice")
        seen.add(key)
        if not 0 <= entry["solved"] <= sizes[entry["set"]]:
            found.append(f"{where}: solved is {entry['solved']} of {sizes[entry['set']]}")
        if entry["claimed"] is not None and (entry["false_claims"] is None or
                                             entry["claimed"] - entry["false_claims"] > entry["solved"]):
            found.append(f"{where}: more claims are true than environments solved")
        is_whole = entry["solved"] == sizes[entry["set"]]
        if is_whole and (entry["residual_max"] is None or entry["residual_max"] > 1.1 * entry["tolerance"]):
            found.append(f"{where}: all solved, with a residual of {entry['residual_max']}")
    return found


def join(first, second):
    """The first run, with the second's other sets or other solvers. ValueError where they are not of one kind."""
    for name in ("machine", "processor", "tolerances", "seconds", "seed"):
        if first[name] != second[name]:
            raise ValueError(f"the runs differ in '{name}'")
    known = {one["name"] for one in first["sets"]}
    solvers = first["solvers"] + [one for one in second["solvers"] if one not in first["solvers"]]
    done = {(entry["set"], entry["solver"]) for entry in first["entries"]}
    refusals = {}
    for one in first["refusals"] + second["refusals"]:
        own = refusals.setdefault((one["solver"], one["reason"]), {**one, "sets": []})
        own["sets"] = own["sets"] + [name for name in one["sets"] if name not in own["sets"]]
    return {**first, "sets": first["sets"] + [one for one in second["sets"] if one["name"] not in known], "solvers": solvers,
            "absent": first["absent"] + [one for one in second["absent"] if one not in first["absent"]],
            "refusals": list(refusals.values()),
            "entries": first["entries"] + [one for one in second["entries"] if (one["set"], one["solver"]) not in done]}


def compare(first, second):
    """The first run, its `machines_equal` compared with another machine's. ValueError where nothing can be compared."""
    versions = {one["name"]: one["version"] for one in second["solvers"]}
    ours = {one["name"] for one in first["solvers"] if versions.get(one["name"]) == one["version"]}
    sets = {one["name"] for one in first["sets"] if one in second["sets"]}
    if first["seed"] != second["seed"]:
        sets = {name for name in sets if not name.startswith("hidden/")}
    there = {(one["set"], one["solver"], one["tolerance"], one["setting"]): one["hash"] for one in second["entries"]}
    entries, compared = [], 0
    for entry in first["entries"]:
        found = there.get((entry["set"], entry["solver"], entry["tolerance"], entry["setting"]))
        if entry["set"] in sets and entry["solver"] in ours and found is not None and not entry["note"]:
            compared += 1
            entry = {**entry, "machines_equal": found == entry["hash"] and entry["machines_equal"] is not False}
        entries.append(entry)
    if not compared:
        raise ValueError("the runs have no entry of the same set, solver, version and setting")
    return {**first, "entries": entries}, compared


def packed(ledger):
    """With entries as lists, which is how they are stored."""
    return {**ledger, "entry_columns": list(ENTRY), "entries": [[entry[name] for name in ENTRY] for entry in ledger["entries"]]}


def unpacked(stored):
    """ValueError where an entry has not as many values as there are columns."""
    columns = stored.get("entry_columns")
    if not isinstance(columns, list) or any(not isinstance(one, list) or len(one) != len(columns)
                                            for one in stored.get("entries", [])):
        raise ValueError("entry_columns and entries do not fit each other")
    rest = {name: value for name, value in stored.items() if name != "entry_columns"}
    younger = {} if "machines_equal" in columns else {"machines_equal": None}  # runs before there was such a column
    return {**rest, "entries": [{**dict(zip(columns, one)), **younger} for one in stored["entries"]]}


def write(path, ledger):
    """One item a line, so that an entry by pull request is a line of the difference."""
    lines = []
    for name, value in packed(ledger).items():
        if isinstance(value, list) and value and isinstance(value[0], (dict, list)):
            body = ",\n".join(json.dumps(item, allow_nan=False, separators=(",", ":")) for item in value)
            lines.append(f'"{name}": [\n{body}\n]')
        else:
            lines.append(f'"{name}": {json.dumps(value, allow_nan=False)}')
    pathlib.Path(path).parent.mkdir(parents=True, exist_ok=True)
    pathlib.Path(path).write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def read(path):
    """ValueError with the first things that are wrong."""
    ledger = unpacked(json.loads(pathlib.Path(path).read_text(encoding="utf-8")))
    wrong = check(ledger)
    if wrong:
        raise ValueError(f"{path}: " + "; ".join(wrong[:5]))
    return ledger
