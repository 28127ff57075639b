#!/usr/bin/env python3
"""tools/check_law.py and `stiction verify` on random batches of every kind of cone: two judges that share no code.

usage: test_check_law.py STICTION [unittest arguments]

Exits with 77 (skipped) when numpy or h5py is missing, and says which.
"""
import contextlib
import io
import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

try:
    import numpy as np

    import check_law
    import h5py
except ImportError as missing:
    print(f"SKIPPED: the judge is not tested, {missing}")
    sys.exit(77)

STICTION = ""
SIZES = {check_law.FREE: [1], check_law.UNILATERAL: [1], check_law.BOX: [1], check_law.FRICTION: range(2, 7),
         check_law.BOX_FRICTION: range(2, 7), check_law.SEMIDEFINITE: [3, 6]}


def environment(rng, smallest, largest):
    """Cones of random kinds in two islands: (kinds, sizes, A, b, R, parameter, low, high)."""
    kinds = rng.integers(0, 6, rng.integers(1, 7))
    sizes = np.array([rng.choice(SIZES[kind]) for kind in kinds])
    n, cone = sizes.sum(), np.repeat(np.arange(len(kinds)), sizes)
    factor = rng.standard_normal((n, n + 2)) * 10.0 ** rng.uniform(-1, 1, (n, 1))
    A = factor @ factor.T * np.equal.outer(cone % 2, cone % 2)
    b = rng.standard_normal(n) * np.where(cone % 2 == 0, 1.0, 1e5)
    R = rng.choice([0.0, 0.25], n)
    stuck = rng.random(n) < 0.1
    A[stuck], A[:, stuck], R[stuck] = 0, 0, 0
    parameter = np.where(rng.random(n) < 0.2, 0, 10.0 ** rng.uniform(smallest, largest, n))
    low, high = rng.uniform(-1, 0.5, n), rng.uniform(0.5, 2, n)
    for bound, none in ((low, [-np.inf, -1e20]), (high, [np.inf, 3e22])):
        free = rng.random(n) < 0.3
        bound[free] = rng.choice(none, free.sum())
    return kinds, sizes, A, b, R, parameter, low, high


def write(path, envs, law):
    pointer = lambda counts: np.concatenate(([0], np.cumsum(counts))).astype(np.int64)  # noqa: E731
    kinds, sizes, matrices, *numbers = zip(*envs)
    with h5py.File(path, "w") as file:
        file.attrs.update(format="contact-batch", version=1, law=law, source="test_check_law.py")
        rows = [len(A) for A in matrices]
        for name, value in (("env_row_ptr", pointer(rows)), ("env_cone_ptr", pointer([len(k) for k in kinds])),
                            ("cone_kind", np.concatenate(kinds).astype(np.uint8)), ("cone_row_ptr", pointer(np.concatenate(sizes))),
                            ("A/ptr", pointer(np.concatenate([np.count_nonzero(A, axis=1) for A in matrices]))),
                            ("A/col", np.concatenate([np.nonzero(A)[1] for A in matrices]).astype(np.int32)),
                            ("A/val", np.concatenate([A[np.nonzero(A)] for A in matrices])),
                            *zip(("b", "R", "row_param", "row_lo", "row_hi"), map(np.concatenate, numbers))):
            file[name] = value
    return sum(rows)


class CheckLaw(unittest.TestCase):
    def setUp(self):
        room = tempfile.TemporaryDirectory()
        self.addCleanup(room.cleanup)
        self.batch, self.answer = Path(room.name) / "batch.h5", Path(room.name) / "answer.h5"

    def verify(self, reaction, law):
        with h5py.File(self.answer, "w") as file:
            file["lambda"] = reaction
        done = subprocess.run([STICTION, "verify", self.batch, self.answer, "--law", law, "--json"], capture_output=True, text=True)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        return json.loads(done.stdout)

    def same(self, reaction, law, place):
        with h5py.File(self.batch) as batch:
            found = check_law.judge(batch, reaction, law)
        said = self.verify(reaction, law)
        env = int(np.argmax(found.relative))
        self.assertEqual((said["worst_environment"], said["worst_cone"]), (env, found.cone[env]), place)
        np.testing.assert_allclose(
            [said["residual"]["min"], said["residual"]["max"], said["worst_error"], said["worst_scale"],
             said["residual_absolute"]["min"], said["residual_absolute"]["max"]],
            [found.relative.min(), found.relative.max(), found.error[env], found.scale[env], found.absolute.min(),
             found.absolute.max()], rtol=1e-9, err_msg=place)

    def test_it_agrees_with_verify(self):
        for seed in range(24):
            rng = np.random.default_rng(seed)
            smallest, largest = [(-1, 1), (-12, -3), (3, 12)][seed % 3]
            rows = write(self.batch, [environment(rng, smallest, largest) for _ in range(8)], "convex")
            for law in ("convex", "coulomb"):
                for size in (1e-3, 1.0):
                    self.same(rng.standard_normal(rows) * size, law, f"seed {seed}, {law}, reactions of {size}")

    def test_it_agrees_with_verify_near_an_answer(self):
        """One contact at a time: 1e-3 from an answer of each member of the law, rows of many units."""
        rng = np.random.default_rng(7)
        for case in range(24):
            law, size = ["convex", "coulomb"][case % 2], 2 + case // 2 % 5
            mu, d = 10.0 ** rng.uniform(-3, 3, size), 10.0 ** rng.uniform(-3, 3, size)
            way = rng.standard_normal(size - 1)
            slide = mu[1:] * way / np.linalg.norm(mu[1:] * way) * mu[1:]
            force, motion = [(np.zeros(size), np.append(2 * np.linalg.norm(mu[1:] * way), way)),
                             (np.append(1, -0.5 * slide), np.zeros(size)),
                             (np.append(1, -slide), np.append(np.linalg.norm(mu[1:] * way) * (law == "convex"), way))][case % 3]
            write(self.batch, [([check_law.FRICTION], [size], np.diag(d), motion - d * force, np.zeros(size), mu, 0 * d, 0 * d)], law)
            with h5py.File(self.batch) as batch:
                self.assertLess(check_law.residuals(batch, force)[0], 1e-9, case)
            self.same(force + 1e-3 * rng.standard_normal(size) / d, law, f"case {case}, {law}, {size} rows")

    def test_islands_are_those_of_the_matrix(self):
        left, right = np.array([3, 5, 7, 0]), np.array([5, 7, 9, 1])
        self.assertEqual(check_law.islands(10, left, right).tolist(), [0, 0, 2, 3, 4, 3, 6, 3, 8, 3])

    def test_the_command_says_which_contact(self):
        rng = np.random.default_rng(2)
        rows = write(self.batch, [environment(rng, -1, 1) for _ in range(3)], "coulomb")
        with h5py.File(self.answer, "w") as file:
            file["lambda"] = np.ones(rows)
        text = io.StringIO()
        with contextlib.redirect_stdout(text):
            self.assertEqual(check_law.main([str(self.batch), str(self.answer), "--worst", "1"]), 1)
            self.assertEqual(check_law.main([str(self.batch), str(self.answer), "--tolerance", "1e300", "--quiet"]), 0)
        self.assertIn("3 environments, law coulomb", text.getvalue())
        self.assertRegex(text.getvalue(), r"environment \d: cone \d \(\w+\), relative")


if __name__ == "__main__":
    STICTION = sys.argv.pop(1)
    unittest.main()
