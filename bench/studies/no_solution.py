#!/usr/bin/env python3
"""Shows for environments of a batch under Coulomb's law that no reaction solves them, without any of our solvers.

    bench/studies/no_solution.py BATCH.h5 [--environments 17,36] [--largest 50] [--sectors 8] [--timeout 60]

Each contact is open, sticks, or slides in one of several sectors of directions. In each of these states Coulomb's law
implies linear inequalities for lambda and w = A lambda + b. (They are of the cone and of the direction of sliding
polygons that contain them.) So together they are a mixed-integer program, solved by HiGHS. If that has no solution,
neither has the environment. That holds for reactions of at most --largest in every row, and to within HiGHS' tolerance
of 1e-6 in every row. If it has one, or none was found in time, nothing follows. Rows with numbers beyond 1e6 are
divided by the largest of them, and the directions of sliding that they belong to are left free. Prints as well how
many entries of A no mechanism can have made. They are numbers that are not zero and smaller than 1e-300, or larger
than 1e30. Friction cones of three rows with one coefficient only. Needs numpy, scipy and h5py; without them it exits
with 77.
"""

import argparse
import sys

try:
    import h5py
    import numpy as np
    import scipy.sparse as sparse
    from scipy.optimize import Bounds, LinearConstraint, milp
except ImportError as missing:
    print(f"SKIPPED: {missing}")
    sys.exit(77)

WILD = 1e6
INFEASIBLE = 2


class Conditions:
    """Rows low <= coefficients z <= high."""

    def __init__(self, columns):
        self.columns, self.entries, self.low, self.high = columns, ([], [], []), [], []

    def add(self, low, high, *terms):
        """Terms are (column or columns, factor or factors)."""
        for column, factor in terms:
            column, factor = np.broadcast_arrays(np.atleast_1d(column), np.atleast_1d(factor))
            for whole, part in zip(self.entries, (np.full(len(column), len(self.low)), column, factor)):
                whole.extend(part)
        self.low.append(low)
        self.high.append(high)

    def matrix(self):
        row, column, factor = self.entries
        return sparse.csr_matrix((factor, (row, column)), shape=(len(self.low), self.columns))


def relaxation(A, b, mu, sectors, largest):
    """Columns: lambda, then for each contact whether it is open, sticks, or slides in each sector."""
    n = len(b)
    contacts, states = n // 3, 2 + sectors
    some = Conditions(n + contacts * states)
    everywhere = np.arange(n)
    size = np.abs(A).max(1)
    tame = size <= WILD
    unit = np.where(tame, 1.0, size)
    A, b = A / unit[:, None], b / unit
    reach = np.abs(A).sum(1) * largest + np.abs(b)  # of |w|
    for contact in range(contacts):
        normal, first = 3 * contact, 3 * contact + 1
        tangent = np.array([first, first + 1])
        friction = mu[first]
        is_open, sticks = n + contact * states, n + contact * states + 1
        some.add(1, 1, (is_open + np.arange(states), 1))
        some.add(-np.inf, largest, (normal, 1), (is_open, largest))
        for turn in (np.arange(2 * sectors) + 0.5) * np.pi / sectors:
            some.add(-np.inf, 0, (normal, -friction), (tangent, [np.cos(turn), np.sin(turn)]))
        some.add(-b[normal], np.inf, (everywhere, A[normal]))
        some.add(-np.inf, -b[normal], (everywhere, A[normal]), (is_open, -reach[normal]))
        for row in tangent:
            some.add(-np.inf, reach[row] - b[row], (everywhere, A[row]), (sticks, reach[row]))
            some.add(-reach[row] - b[row], np.inf, (everywhere, A[row]), (sticks, -reach[row]))
        for sector in range(sectors):
            slides = is_open + 2 + sector
            begin, end = 2 * np.pi * sector / sectors, 2 * np.pi * (sector + 1) / sectors
            middle = 0.5 * (begin + end)
            spare = 4 * friction * largest
            along = np.array([np.cos(middle), np.sin(middle)])
            sides = [np.array([-np.sin(begin), np.cos(begin)]), np.array([np.sin(end), -np.cos(end)])]
            some.add(-spare, np.inf, (tangent, along), (normal, -friction * np.cos(np.pi / sectors)), (slides, -spare))
            for inside in sides:
                some.add(-spare, np.inf, (tangent, inside), (slides, -spare))
            if tame[tangent].all():
                spare = reach[tangent].sum()
                for inside in [along, *sides]:
                    some.add(-spare + inside @ b[tangent], np.inf, (everywhere, -(inside @ A[tangent])), (slides, -spare))
    bound = np.repeat([largest], n) * np.where(everywhere % 3 == 0, 1.0, mu)
    low = np.concatenate([np.where(everywhere % 3 == 0, 0.0, -bound), np.zeros(contacts * states)])
    return some, Bounds(low, np.concatenate([bound, np.ones(contacts * states)]))


def environment(batch, index):
    begin, end = batch["env_row_ptr"][index:index + 2]
    offsets = batch["A/ptr"][begin:end + 1]
    stored = slice(offsets[0], offsets[-1])
    A = sparse.csr_matrix((batch["A/val"][stored], batch["A/col"][stored], offsets - offsets[0]),
                          shape=(end - begin, end - begin)).toarray() + np.diag(batch["R"][begin:end])
    first, last = batch["env_cone_ptr"][index:index + 2]
    sizes = np.diff(batch["cone_row_ptr"][first:last + 1])
    if (batch["cone_kind"][first:last] != 3).any() or (sizes != 3).any():
        sys.exit(f"environment {index}: friction cones of three rows only")
    mu = batch["row_param"][begin:end]
    if (mu[1::3] != mu[2::3]).any():
        sys.exit(f"environment {index}: both axes must have the same friction")
    return A, batch["b"][begin:end], mu


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("batch")
    parser.add_argument("--environments")
    parser.add_argument("--largest", type=float, default=50)
    parser.add_argument("--sectors", type=int, default=8)
    parser.add_argument("--timeout", type=float, default=60)
    arguments = parser.parse_args()
    with h5py.File(arguments.batch) as batch:
        chosen = range(len(batch["env_row_ptr"]) - 1)
        if arguments.environments:
            chosen = [int(index) for index in arguments.environments.split(",")]
        for index in chosen:
            A, b, mu = environment(batch, index)
            size = np.abs(A)
            strange = int(((size > 0) & (size < 1e-300)).sum() + (size > 1e30).sum())
            A[size < 1e-300] = 0.0
            verdict = "solved by zero"
            if len(b) > 0:
                some, bounds = relaxation(A, b, mu, arguments.sectors, arguments.largest)
                integrality = np.arange(some.columns) >= len(b)
                found = milp(np.zeros(some.columns), constraints=LinearConstraint(some.matrix(), some.low, some.high),
                             bounds=bounds, integrality=integrality, options={"time_limit": arguments.timeout})
                verdict = "NO SOLUTION" if found.status == INFEASIBLE else "not excluded"
            print(f"environment {index}: {len(b)} rows, {strange} strange entries of A, {verdict}", flush=True)


if __name__ == "__main__":
    main()
