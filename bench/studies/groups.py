#!/usr/bin/env python3
"""How many sweeps it takes with cones one by one, and with groups of them that are solved together exactly.

    PYTHONPATH=build/python bench/studies/groups.py --data FOLDER [--most 2000] [--tolerance 1e-6] [-o FILE.csv]

Gauss-Seidel over groups: a sweep visits every group once. A visit leaves the group's cones with their answer to all
other reactions (`auto`, to 1e-12). With groups of one cone that is a sweep of `nsgs`. Groups are made from the
strongest coupling down: two are joined if together they are not too large. The coupling of two cones is the largest
|A_ij| / sqrt(A_ii A_jj) between them. Counted are sweeps from no reaction to a relative residual (stiction.verify),
medians over up to --envs environments of a file. Those that are not there after --most sweeps count as that many. What
a visit costs is not counted.
"""

import argparse
import csv
import pathlib

import h5py
import numpy as np

import stiction

FILES = ("sequences/stack5_mu05", "sequences/heap12_mu07", "coulomb/boxes", "coulomb/spheres", "mujoco/franka_cube",
         "mujoco/aloha_peg", "mujoco/leap_hand", "mujoco/g1")
SIZES = (1, 2, 4, 8)
NAMES = ("free", "unilateral", "box", "friction")


class Problem:
    """One environment, dense: A with R on its diagonal, and which rows each cone has."""

    def __init__(self, file, env):
        first, end = file["env_row_ptr"][env:env + 2]
        n = end - first
        ptr = file["A/ptr"][first:end + 1]
        self.A = np.zeros((n, n))
        columns, values = file["A/col"][ptr[0]:ptr[-1]], file["A/val"][ptr[0]:ptr[-1]]
        np.add.at(self.A, (np.repeat(np.arange(n), np.diff(ptr)), columns), values)
        self.A += np.diag(file["R"][first:end])
        self.b, param = file["b"][first:end], file["row_param"][first:end]
        cone, cone_end = file["env_cone_ptr"][env:env + 2]
        begin = file["cone_row_ptr"][cone:cone_end + 1] - first
        self.rows = [np.arange(a, z) for a, z in zip(begin, begin[1:])]
        self.kinds = [NAMES[kind] for kind in file["cone_kind"][cone:cone_end]]
        is_box = np.concatenate([np.full(len(rows), kind == "box") for rows, kind in zip(self.rows, self.kinds)] or [[]])
        self.bound = np.where(is_box, param, 0.0)
        self.mu = np.where(is_box, 0.0, param)

    def groups(self, size):
        """Lists of cones, each of at most `size`."""
        scale = 1 / np.sqrt(np.maximum(np.diag(self.A), 1e-300))
        scaled = np.abs(self.A * scale[:, None] * scale[None, :])
        count = len(self.rows)
        coupling = sorted(((scaled[np.ix_(self.rows[i], self.rows[k])].max(), -i, -k) for i in range(count)
                           for k in range(i)), reverse=True)
        group = [{i} for i in range(count)]
        for strength, i, k in coupling:
            joined = group[-i] | group[-k]
            if strength > 0 and len(joined) <= size:
                for one in joined:
                    group[one] = joined
        return sorted({tuple(sorted(one)) for one in group})


def batch_of(problems, law, cones=None):
    """Those problems, or of each the cones listed, as one batch; and of each the rows that are in it."""
    chosen = [range(len(p.rows)) for p in problems] if cones is None else cones
    rows = [np.concatenate([p.rows[i] for i in c]) for p, c in zip(problems, chosen)]

    def taken(name):
        return [getattr(p, name)[r] for p, r in zip(problems, rows)]

    batch = stiction.Batch.from_delassus(
        [p.A[np.ix_(r, r)] for p, r in zip(problems, rows)], taken("b"), mu=taken("mu"), hi=taken("bound"),
        lo=[-bound for bound in taken("bound")], law=law,
        cones=[[(p.kinds[i], len(p.rows[i])) for i in c] for p, c in zip(problems, chosen)])
    return batch, rows


class Sweeps:
    """Gauss-Seidel over groups of cones, of several problems at once."""

    def __init__(self, problems, law, size):
        self.problems, self.whole = problems, batch_of(problems, law)[0]
        self.reactions = [np.zeros(len(p.b)) for p in problems]
        self.solver = stiction.Solver(solver="auto", tolerance=1e-12, threads=1)
        self.failed = self.visits = 0
        groups = [p.groups(size) for p in problems]
        self.turns = []
        for turn in range(max(map(len, groups))):
            who = [i for i, g in enumerate(groups) if turn < len(g)]
            batch, rows = batch_of([problems[i] for i in who], law, [groups[i][turn] for i in who])
            self.turns.append((who, batch, rows))

    def sweep(self):
        for who, batch, rows in self.turns:
            start = []
            for i, r in zip(who, rows):
                p, f = self.problems[i], self.reactions[i]
                start.append(p.b[r] + p.A[r] @ f - p.A[np.ix_(r, r)] @ f[r])
            batch.arrays["b"][:] = np.concatenate(start)
            guess = np.concatenate([self.reactions[i][r] for i, r in zip(who, rows)])
            answer = self.solver.solve(batch, warm_start=guess)
            self.visits += len(who)
            self.failed += int((~answer.solved).sum())
            at = 0
            for i, r in zip(who, rows):
                self.reactions[i][r] = answer.lambda_[at:at + len(r)]
                at += len(r)

    def count(self, tolerance, most):
        """Sweeps of each problem until its residual is that small."""
        needed = np.full(len(self.problems), most)
        for done in range(1, most + 1):
            self.sweep()
            is_there = stiction.verify(self.whole, np.concatenate(self.reactions))[:, 0] <= tolerance
            needed[is_there & (needed == most)] = done
            if (needed < most).all():
                break
        return needed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--envs", type=int, default=8)
    parser.add_argument("--most", type=int, default=2000)
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--files", nargs="+", default=FILES)
    parser.add_argument("-o", "--output", type=pathlib.Path)
    options = parser.parse_args()
    table = []
    for name in options.files:
        with h5py.File(options.data / f"{name}.h5") as file:
            count = len(file["env_row_ptr"]) - 1
            sizes = np.diff(file["env_cone_ptr"][:])
            chosen = [e for e in np.linspace(0, count - 1, 4 * options.envs).astype(int) if sizes[e] > 1]
            chosen = sorted(set(chosen))[::-1][:options.envs]  # the later: stacks have been built, hands have closed
            problems, law = [Problem(file, env) for env in chosen], file.attrs["law"]
        row = {"file": name, "law": law, "environments": len(problems),
               "cones": float(np.mean([len(p.rows) for p in problems]))}
        for size in SIZES:
            sweeps = Sweeps(problems, law, size)
            needed = sweeps.count(options.tolerance, options.most)
            row |= {f"sweeps_{size}": float(np.median(needed)), f"late_{size}": int((needed == options.most).sum()),
                    f"failed_{size}": f"{sweeps.failed / max(sweeps.visits, 1):.2g}"}
        table.append(row)
        print(" ".join(f"{key}={value}" for key, value in row.items()), flush=True)
    if options.output:
        with open(options.output, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(table[0]))
            writer.writeheader()
            writer.writerows(table)


if __name__ == "__main__":
    main()
