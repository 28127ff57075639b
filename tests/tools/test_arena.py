#!/usr/bin/env python3
"""bench/arena. Its judge is compared with hand answers and the shared judge. Wrong answers, NaN and false
claims are caught. Bits that depend on order, threads or the processor are seen. A quick run makes a JSON and a page.

usage: test_arena.py STICTION [unittest arguments]

Exits with 77 (skipped) when numpy or h5py is missing, and says which. Tests whose packages are missing skip themselves.
"""
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench" / "arena"))

try:
    import numpy as np

    import answer_file
    import h5py
    import arena
    import families
    import judge
    import ledger
    import page
    from batch_file import take
    from bits import digest, restored
    from course import Course, verdict
    from ours import Stiction
except ImportError as missing:
    print(f"SKIPPED: the arena is not tested, {missing}")
    sys.exit(77)

STICTION = ""
SHARED = Path(os.environ.get("STICTION_SHARED_DIR", ROOT.parent / "shared"))
GOAL = 1e-6


def one_cone(kind, b, mu, law="coulomb", low=None, high=None):
    """An open file of one cone with A = I."""
    file = h5py.File(f"{kind}", "w", driver="core", backing_store=False)
    n = len(b)
    file.attrs["law"] = law
    for name, value in (("env_row_ptr", [0, n]), ("env_cone_ptr", [0, 1]), ("cone_kind", [kind]), ("cone_row_ptr", [0, n]),
                        ("row_param", mu), ("A/ptr", np.arange(n + 1)), ("A/col", np.arange(n)), ("A/val", np.ones(n)), ("b", b),
                        ("R", np.zeros(n))):
        file[name] = np.asarray(value)
    if low is not None:
        file["row_lo"], file["row_hi"] = np.array([low]), np.array([high])
    return file


def shared_judge():
    path = SHARED / "tools" / "check_law.py"
    if not path.exists():
        return None
    spec = importlib.util.spec_from_file_location("check_law", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.residuals


class Order(Stiction):
    """A solver whose answer depends on the environments before, on the number of threads, or on the processor."""

    by_place = by_threads = by_machine = 0.0

    def solve(self, path, law, setting, seconds, folder, threads=1, repeat=1, older=False):
        answer = super().solve(path, law, setting, seconds, folder, threads, repeat, older)
        answer.reaction = answer.reaction + self.by_place * np.arange(len(answer.reaction)) + self.by_threads * threads
        answer.reaction += self.by_machine * older
        return answer


class Arena(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.room = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.room.name)
        sets = families.Sets(STICTION, cls.folder / "sets", 4)
        cls.scenes = list(sets.scenes("generated", 7, {"stack": 2, "column": 8, "walker": 0, "grasp": 0, "mixed": 16}))
        cls.scenes += sets.scenes("boxed", 7, {"stack": 2, "mixed": 16}, "--box-friction")
        cls.stack = cls.scenes[0]
        cls.entrant = Stiction(STICTION, "auto")
        cls.entrant.prepare(cls.folder, None)

    @classmethod
    def tearDownClass(cls):
        cls.room.cleanup()

    def solved(self):
        answer = self.entrant.solve(self.stack.path, self.stack.law, GOAL, 1.0, self.folder)
        self.assertTrue(answer.claimed.all())
        return answer

    # The judge.

    def test_the_judge_finds_the_hand_answers(self):
        for law, reaction in (("coulomb", [2, -1, 0]), ("convex", [2.8, -1.4, 0])):  # docs/math/residual.md
            with one_cone(judge.FRICTION, [-2.0, 3.0, 0.0], [0, 0.5, 0.5], law) as file:
                self.assertLess(judge.residuals(file, reaction)[0], 1e-15)
                other = judge.residuals(file, reaction, "convex" if law == "coulomb" else "coulomb")[0]
                self.assertGreater(other, 0.1)
        with one_cone(judge.UNILATERAL, [-4.0], [0]) as file:
            self.assertEqual(judge.residuals(file, [4.0])[0], 0)
            self.assertEqual(judge.residuals(file, [3.0])[0], 0.25)  # w = -1 of the 4 without a reaction
            self.assertAlmostEqual(judge.residuals(file, [-1.0])[0], np.hypot(1, 5) / 4)  # w = -5
        with one_cone(judge.BOX, [-4.0], [np.nan], low=-1.0, high=2.0) as file:
            self.assertEqual(judge.residuals(file, [2.0])[0], 0)
            self.assertEqual(judge.residuals(file, [-1.0])[0], 1.5)  # 3 from the upper bound, where 2 are missing without a reaction
        with one_cone(judge.BOX, [4.0], [np.nan], low=-1.0, high=2.0) as file:
            self.assertEqual(judge.residuals(file, [-1.0])[0], 0)
        with one_cone(judge.FREE, [-4.0], [0]) as file:
            self.assertEqual(judge.residuals(file, [4.0])[0], 0)

    def test_the_judge_finds_answers_of_boxed_friction(self):
        # At (2, 0, 0) each axis is 1 from its bound; without reactions the normal row is off by 2.
        with one_cone(judge.BOX_FRICTION, [-2.0, 3.0, -4.0], [0, 0.5, 0.5], "convex") as file:
            self.assertEqual(judge.residuals(file, [2.0, -1.0, 1.0])[0], 0)
            self.assertAlmostEqual(judge.residuals(file, [2.0, 0.0, 0.0])[0], 2 ** 0.5 / 2)
        with one_cone(judge.BOX_FRICTION, [-2.0, 0.0, 0.0], [0, 0.5, 0.0]) as file:
            self.assertEqual(judge.residuals(file, [2.0, 0.0, 0.25])[0], 0.125)

    def test_the_judge_finds_answers_of_semidefinite_cones(self):
        # The nearest matrix to [0 1; 1 0] is [1 1; 1 1] / 2, at distance 1.
        root = 2 ** 0.5
        with one_cone(judge.SEMIDEFINITE, [0.0, -root, 0.0], [0, 0, 0]) as file:
            self.assertAlmostEqual(judge.residuals(file, [0.5, 0.5 * root, 0.5])[0], 0)
            self.assertAlmostEqual(judge.residuals(file, [0.0, 0.0, 0.0])[0], 1)
            self.assertAlmostEqual(judge.residuals(file, [0.5, 0.0, 0.5])[0], 0.5 * root)  # w = [.5 -1; -1 .5], z = [0 1; 1 0]
        with one_cone(judge.SEMIDEFINITE, [0.0, 0.0, -2.0, 0.0, 0.0, 1.0], [0] * 6) as file:
            self.assertAlmostEqual(judge.residuals(file, [0.0, 0.0, 2.0, 0.0, 0.0, 0.0])[0], 0)
            self.assertAlmostEqual(judge.residuals(file, [3.0, 0.0, 2.0, 0.0, 4.0, 0.0])[0], 2.5)
            self.assertEqual(judge.residuals(file, [np.nan, 0.0, 2.0, 0.0, 0.0, 0.0])[0], np.inf)

    def test_an_axis_without_friction_carries_nothing(self):
        with one_cone(judge.FRICTION, [-2.0, 0.0, 0.0], [0, 0.5, 0.0]) as file:
            self.assertEqual(judge.residuals(file, [2.0, 0.0, 0.0])[0], 0)
            self.assertEqual(judge.residuals(file, [2.0, 0.0, 0.25])[0], 0.125)

    def test_what_is_not_finite_is_infinite(self):
        with one_cone(judge.UNILATERAL, [-4.0], [0]) as file:
            for value in (np.nan, np.inf, -np.inf, 1e308 * 10):
                self.assertEqual(judge.residuals(file, [value])[0], np.inf)
        with one_cone(judge.UNILATERAL, [np.nan], [0]) as file:
            self.assertEqual(judge.residuals(file, [0.0])[0], np.inf)
        with one_cone(judge.FRICTION, [-2.0, 1e10, 0.0], [0, 1e300, 1e300], "convex") as file:  # mu w_t is no double
            self.assertEqual(judge.residuals(file, [0.0, 0.0, 0.0])[0], 1)
        with one_cone(judge.FRICTION, [-2.0, 1.0, 0.0], [0, np.inf, 1.0]) as file:
            self.assertEqual(judge.residuals(file, [0.0, 0.0, 0.0])[0], np.inf)
        with self.assertRaises(ValueError), one_cone(judge.UNILATERAL, [1.0], [0]) as file:
            judge.residuals(file, [0.0, 0.0])

    def test_the_judge_agrees_with_the_shared_judge(self):
        residuals = shared_judge()
        if residuals is None:
            self.skipTest(f"no check_law.py in {SHARED}")
        recorded = [path for name in ("mujoco/car", "coulomb/small", "coulomb/lmgc90", "coulomb/spheres")
                    for path in [SHARED / "data" / f"{name}.h5"] if path.exists()]
        rng = np.random.default_rng(4)
        for path in [*recorded, *(problems.path for problems in self.scenes if not problems.is_boxed)]:
            with h5py.File(path) as batch:
                law, reaction = judge.law_of(batch), rng.standard_normal(len(batch["b"]))
                np.testing.assert_allclose(judge.residuals(batch, reaction, law), residuals(batch, reaction, law), rtol=1e-9,
                                           err_msg=str(path))

    # Mistakes that are caught.

    def test_a_wrong_answer_is_caught(self):
        answer = self.solved()
        right, _ = verdict(self.stack, answer, GOAL)
        self.assertEqual((right["solved"], right["false_claims"]), (4, 0))
        own = slice(*self.stack.offsets[2:4])
        answer.reaction[own] *= np.where(answer.reaction[own] == answer.reaction[own].max(), 1.001, 1)
        wrong, solved = verdict(self.stack, answer, GOAL)
        self.assertEqual((wrong["solved"], wrong["claimed"], wrong["false_claims"]), (3, 4, 1))
        self.assertEqual(solved.tolist(), [True, True, False, True])
        self.assertNotEqual(wrong["hash"], right["hash"])

    def test_a_nan_is_caught(self):
        answer = self.solved()
        answer.reaction[-1] = np.nan
        entry, _ = verdict(self.stack, answer, GOAL)
        self.assertEqual((entry["solved"], entry["false_claims"], entry["residual_max"]), (3, 1, None))

    def test_a_claim_that_is_not_so_is_caught(self):
        answer = answer_file.Answer(np.zeros(self.stack.rows), claimed=np.ones(4, bool))
        entry, _ = verdict(self.stack, answer, GOAL)
        self.assertEqual((entry["solved"], entry["false_claims"]), (0, 4))
        answer.claimed = None
        self.assertIsNone(verdict(self.stack, answer, GOAL)[0]["false_claims"])

    def test_bits_that_depend_on_order_threads_or_the_processor_are_seen(self):
        for by_place, by_threads, by_machine in ((0, 0, 0), (1e-12, 0, 0), (0, 1e-12, 0), (0, 0, 1e-12)):
            entrant = Order(STICTION, "auto")
            entrant.prepare(self.folder, None)
            entrant.by_place, entrant.by_threads, entrant.by_machine = by_place, by_threads, by_machine
            entry = Course(entrant, self.stack, 1.0, self.folder).run(1e-4)
            self.assertEqual((entry["permuted_equal"], entry["threads_equal"], entry["machines_equal"]),
                             (by_place == 0, by_threads == 0, by_machine == 0))
            self.assertEqual(entry["solved"], 4)

    def test_a_tighter_setting_mends_what_a_looser_one_claims(self):
        asked = []

        class Loose(Stiction):
            """Stops by a measure of which 1e-4 is too little for three environments, and 1e-6 for one."""

            def settings(self, goal):
                return [1e-4, 1e-6, 1e-8]

            def solve(self, path, law, setting, seconds, folder, threads=1, repeat=1, older=False):
                answer = super().solve(path, law, 1e-9, seconds, folder, threads, repeat, older)
                count = len(answer.claimed)
                asked.append((setting, count))
                off = {1e-4: [0, 1, 1, 1], 1e-6: [0, 1, 0], 1e-8: [0]}[setting][:count]
                with h5py.File(path) as batch:
                    answer.reaction = answer.reaction * np.repeat(1 + 1e-3 * np.array(off), np.diff(batch["env_row_ptr"][:]))
                answer.seconds = np.full(count, setting)
                return answer

        entrant = Loose(STICTION, "auto")
        entrant.prepare(self.folder, None)
        entry = Course(entrant, self.stack, 1.0, self.folder).run(1e-6)
        self.assertEqual(asked[:3], [(1e-4, 4), (1e-6, 3), (1e-8, 1)])
        self.assertEqual((entry["solved"], entry["claimed"], entry["false_claims"], entry["setting"]), (4, 4, 0, 1e-8))
        self.assertAlmostEqual(entry["us"], 1e6 * (1e-4 + 2 * 1e-6 + 1e-8) / 4, 1)  # of the call that each answer came from

    def test_a_solve_that_takes_too_long_is_no_answer(self):
        late = self.entrant.solve(self.stack.path, self.stack.law, GOAL, 1e-9, self.folder)
        self.assertTrue(late.late and np.isnan(late.reaction).all() and not late.claimed.any())
        entry, _ = verdict(self.stack, late, GOAL)
        self.assertEqual((entry["solved"], entry["false_claims"], entry["residual_max"]), (0, 0, None))

    def test_a_hash_is_of_bits(self):
        self.assertNotEqual(digest([0.0]), digest([-0.0]))
        self.assertEqual(digest([np.nan]), digest([-np.nan]))
        self.assertNotEqual(digest([1.0, 2.0]), digest([2.0, 1.0]))

    # Sets.

    def test_environments_come_back_from_another_order(self):
        walker = self.scenes[2]
        order = np.array([2, 0, 3, 1])
        there = take(walker.path, order, self.folder / "there.h5")
        back = take(there, np.argsort(order), self.folder / "back.h5")
        with h5py.File(walker.path) as one, h5py.File(back) as other:
            names = []
            one.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
            for name in names:
                np.testing.assert_array_equal(one[name][:], other[name][:], name)
            self.assertIn("M/val", names)
        with h5py.File(there) as moved, h5py.File(walker.path) as one:
            self.assertFalse(np.array_equal(moved["b"][:], one["b"][:]))
            ends = one["M/ptr"][:][one["env_dof_ptr"][:]]
            third = one["M/val"][ends[2]:ends[3]]
            self.assertFalse(np.array_equal(third, one["M/val"][:len(third)]))
            np.testing.assert_array_equal(moved["M/val"][:len(third)], third)
            np.testing.assert_array_equal(restored(moved["b"][:], walker.offsets, order), one["b"][:])

    def test_the_hidden_family_is_its_seeds(self):
        made = [next(families.Sets(STICTION, self.folder / place, 2).scenes("hidden", seed, {"stack": 2})).path.read_bytes()
                for place, seed in (("a", 11), ("b", 11), ("c", 12))]
        self.assertEqual(made[0], made[1])
        self.assertNotEqual(made[0], made[2])

    # The ledger and the page.

    def test_a_quick_run_an_entry_and_the_page(self):
        out, peers, html = (self.folder / name for name in ("arena.json", "peers.json", "arena.html"))
        quick = ["run", STICTION, "--quick", "--seed", "5", "--data", str(SHARED / "data")]
        arena.main([*quick, "--solvers", "stiction (auto|lemke)", "--json", str(out)])
        # Each answer of a peer is a process that loads its packages. One set shows a wrapper's work; in the recorded one
        # the first setting suffices.
        known = "mujoco/" if (SHARED / "data" / "mujoco").is_dir() else "generated/walker"
        arena.main([*quick, "--solvers", "Clarabel|Newton", "--sets", known, "--json", str(peers)])
        arena.main(["join", str(out), str(peers), "--json", str(out), "--page", str(html)])
        found = ledger.read(out)
        self.assertEqual(found["seed"], 5)
        keys = {one["name"] for one in found["sets"]}
        self.assertTrue({"generated/stack", "generated/column", "generated/walker", "hidden/stack"} <= keys)
        theirs = {one["solver"] for one in ledger.read(peers)["entries"]}
        self.assertLessEqual(theirs, {one["solver"] for one in found["entries"]})
        ours = [one for one in found["entries"] if one["solver"] == "stiction auto"]
        self.assertEqual(len(ours), len(keys) * len(found["tolerances"]))
        for entry in ours:
            self.assertEqual(entry["false_claims"], 0, entry)
            self.assertIn(entry["permuted_equal"], (True, None), entry)
            self.assertIs(entry["threads_equal"], True, entry)
            self.assertIs(entry["machines_equal"], True, entry)
        self.assertIn("friction cones are none", {one["solver"]: one["reason"] for one in found["refusals"]}["stiction lemke"])
        for entry in found["entries"]:
            self.assertNotIn("Error", entry["note"], entry)  # of a wrapper, not of the solver
        self.check_page(html, found)
        self.check_entering(found, out)

    def check_page(self, html, found):
        text = html.read_text(encoding="utf-8")
        loads = r"(?:src|href)\s*=|url\(|@import|fetch\(|XMLHttpRequest|https?://(?!www\.w3\.org/2000/svg)"
        self.assertFalse(re.search(loads, text))
        self.assertFalse(re.search(r"<!--[A-Z]+-->", text))
        self.assertIn(found["processor"], text)
        chromium = shutil.which("chromium")
        if not chromium:
            print("not looked at: the page in a browser, there is no chromium")
            return
        with tempfile.TemporaryDirectory() as profile:
            seen = subprocess.run([chromium, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
                                   "--dump-dom", html.as_uri()], capture_output=True, text=True, timeout=120).stdout
        standing = seen[seen.index('id="standing"'):seen.index("</table>", seen.index('id="standing"'))]
        entered = {one["solver"] for one in found["entries"]}
        self.assertEqual(standing.count("<tr>"), 1 + len(entered), "a row for each solver that has an entry, and the heading")
        self.assertEqual(seen.count('class="curve"'), len(entered))

    def check_entering(self, found, out):
        """The same answers from outside are judged the same; those that do not fit are refused."""
        sets, answers = self.folder / "given", self.folder / "answers"
        arena.main(["sets", STICTION, str(sets), "--quick", "--seed", "5", "--data", str(self.folder), "--environments", "3"])
        (answers / "generated").mkdir(parents=True)
        (answers / "solver.json").write_text(json.dumps({"name": "outsider", "version": "1", "machine": "elsewhere"}))
        path = sets / "generated" / "stack.h5"
        answer = self.entrant.solve(path, "coulomb", 1e-4, 1.0, self.folder)
        target = answers / "generated" / "stack@1e-4.h5"
        answer_file.write(target, answer)
        answer_file.write(answers / "generated" / "stack@1e-4.permuted.h5", answer)
        arena.main(["judge", str(sets), str(answers), "--json", str(out)])
        after = ledger.read(out)
        self.assertEqual(len(after["entries"]), len(found["entries"]) + 1)
        mine = next(one for one in after["entries"] if one["solver"] == "outsider")
        same = next(one for one in after["entries"] if one["solver"] == "stiction auto" and one["set"] == "generated/stack"
                    and one["tolerance"] == 1e-4)
        for name in ("solved", "residual_max", "residual_p95", "false_claims", "hash", "iterations", "permuted_equal"):
            self.assertEqual(mine[name], same[name], name)
        self.assertIsNone(mine["threads_equal"])
        self.assertIsNone(mine["machines_equal"])
        answer.reaction[0] = np.nan
        answer_file.write(target, answer)
        arena.main(["judge", str(sets), str(answers), "--json", str(out)])
        mine = next(one for one in ledger.read(out)["entries"] if one["solver"] == "outsider")
        self.assertEqual((mine["solved"], mine["false_claims"], mine["permuted_equal"]), (2, 1, False))
        answer_file.write(target, answer_file.Answer(np.zeros(3)))
        with self.assertRaisesRegex(ValueError, "stack@1e-4.h5: lambda has shape"):
            arena.main(["judge", str(sets), str(answers), "--json", str(out)])
        (answers / "solver.json").write_text(json.dumps({"name": "stiction auto", "version": "1"}))
        with self.assertRaisesRegex(ValueError, "is taken"):
            arena.main(["judge", str(sets), str(answers), "--json", str(out)])

    def test_the_page_cannot_be_left_by_its_data(self):
        self.assertNotIn("<", page.embedded({"name": "</script><b>"}))


if __name__ == "__main__":
    STICTION = str(Path(sys.argv.pop(1)).resolve())
    unittest.main()
