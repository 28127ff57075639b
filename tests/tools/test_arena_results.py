#!/usr/bin/env python3
"""The arena's committed run: the ledger is sound, one that is wrong is refused, parts are joined, bench/arena/README.md has its numbers."""
import copy
import re
import sys
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench" / "arena"))

import ledger  # noqa: E402


class Results(unittest.TestCase):
    def test_the_numbers_of_the_page_are_those_of_the_run(self):
        run = ledger.read(ROOT / "bench" / "results" / "amd-epyc-2-cores" / "arena.json")
        text = (ROOT / "bench" / "arena" / "README.md").read_text(encoding="utf-8")
        sizes = {one["name"]: one["environments"] for one in run["sets"]}
        rows = re.findall(r"^\| (.+?) \| (\d+) \| (\d+) of (\d+) \| (\d+) of (\d+) \| (\d+|claims nothing) \|$", text, re.M)
        self.assertEqual(len(rows), 9)
        for title, sets, *solved, claims in rows:
            name = title.replace("`", "").replace(", J and M", " (J, M)")
            own = [entry for entry in run["entries"] if entry["solver"] == name]
            self.assertEqual(len(own), 2 * int(sets), name)
            found = [number for goal in (1e-4, 1e-8) for number in (
                sum(entry["solved"] for entry in own if entry["tolerance"] == goal),
                sum(sizes[entry["set"]] for entry in own if entry["tolerance"] == goal))]
            self.assertEqual(found, list(map(int, solved)), name)
            false = [entry["false_claims"] for entry in own]
            self.assertEqual(claims, "claims nothing" if None in false else str(sum(false)), name)
        ours = [entry for entry in run["entries"] if entry["solver"].startswith("stiction")]
        self.assertEqual(sum(entry["false_claims"] for entry in ours), 0)
        for column, word in (("permuted_equal", "orders"), ("threads_equal", "threads"),
                             ("machines_equal", "machines")):
            compared = [entry[column] for entry in ours if entry[column] is not None]
            self.assertTrue(all(compared))
            self.assertRegex(text, rf"all {len(compared)}\s+(comparisons\s+)?of\s+{word}")
        counts = (f"{len(sizes)} sets, {sum(sizes.values())} environments, {len(run['solvers'])} solvers, "
                  f"{len(run['entries'])} entries")
        self.assertIn(counts, " ".join(text.split()))

    def test_a_ledger_that_is_wrong_is_refused(self):
        path = ROOT / "bench" / "results" / "amd-epyc-2-cores" / "arena.json"
        committed = ledger.read(path)

        def spoiled(**changes):
            found = copy.deepcopy(committed)
            found["entries"][0].update(changes)
            return ledger.check(found)

        count = next(one["environments"] for one in committed["sets"] if one["name"] == committed["entries"][0]["set"])
        for changes in ({"solved": count + 1}, {"solved": 0, "claimed": count, "false_claims": 0}, {"us": "fast"},
                        {"solver": "unheard of"}, {"surprise": 1}, {"residual_max": 1.0, "solved": count}, {"residual_max": None, "solved": count}):
            self.assertTrue(spoiled(**changes), changes)
        found = copy.deepcopy(committed)
        found["entries"].append(found["entries"][0])
        self.assertTrue(ledger.check(found))
        stored = ledger.packed(committed)
        stored["entries"][0] = stored["entries"][0][:-1]
        with self.assertRaises(ValueError):
            ledger.unpacked(stored)

    def test_another_machine_is_compared_entry_by_entry(self):
        here = ledger.read(ROOT / "bench" / "results" / "amd-epyc-2-cores" / "arena.json")
        there = copy.deepcopy(here)
        first, second = [at for at, one in enumerate(here["entries"]) if not one["note"]][:2]
        there["entries"][second]["hash"] = "another"
        both, compared = ledger.compare(here, there)
        self.assertEqual(compared, sum(not one["note"] for one in here["entries"]))
        self.assertEqual([both["entries"][at]["machines_equal"] for at in (first, second)],
                         [here["entries"][first]["machines_equal"] is not False, False])
        self.assertEqual(ledger.check(both), [])
        again, _ = ledger.compare(both, here)  # once other bits, always other bits
        self.assertIs(again["entries"][second]["machines_equal"], False)
        for change in ({"version": "0"}, {"name": "another"}):
            solvers = [{**one, **change} for one in here["solvers"]]
            with self.assertRaisesRegex(ValueError, "no entry"):
                ledger.compare(here, {**there, "solvers": solvers})

    def test_two_parts_make_one_run(self):
        whole = ledger.read(ROOT / "bench" / "results" / "amd-epyc-2-cores" / "arena.json")
        parts = []
        for of_first in (True, False):
            part = copy.deepcopy(whole)
            mine = {one["name"] for one in whole["sets"] if (one["family"] == "generated") == of_first}
            part["sets"] = [one for one in part["sets"] if one["name"] in mine]
            part["entries"] = [one for one in part["entries"] if one["set"] in mine]
            part["refusals"] = [{**one, "sets": [name for name in one["sets"] if name in mine]} for one in part["refusals"]]
            parts.append(part)
        both = ledger.join(*parts)

        def sorted_entries(one):
            return sorted(one["entries"], key=lambda entry: (entry["set"], entry["solver"], entry["tolerance"]))

        self.assertEqual(sorted_entries(both), sorted_entries(whole))
        self.assertEqual({(one["solver"], one["reason"], *sorted(one["sets"])) for one in both["refusals"]},
                         {(one["solver"], one["reason"], *sorted(one["sets"])) for one in whole["refusals"]})
        self.assertEqual(sorted_entries(ledger.join(whole, parts[0])), sorted_entries(whole))
        auto, rest = copy.deepcopy(whole), copy.deepcopy(whole)
        for part, is_in in ((auto, lambda one: one == "stiction auto"), (rest, lambda one: one != "stiction auto")):
            part["solvers"] = [one for one in part["solvers"] if is_in(one["name"])]
            part["entries"] = [one for one in part["entries"] if is_in(one["solver"])]
        self.assertEqual(sorted_entries(ledger.join(auto, rest)), sorted_entries(whole))
        with self.assertRaisesRegex(ValueError, "'seed'"):
            ledger.join(parts[0], {**parts[1], "seed": whole["seed"] + 1})


if __name__ == "__main__":
    unittest.main()
