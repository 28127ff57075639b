#!/usr/bin/env python3
"""Answers of every solver to degenerate input:

* redundant contacts, mass ratios, friction 0 and 2;
* problems without a solution, singular matrices without compliance;
* numbers at the ends of their range, and broken ones.

    bench/studies/degenerate.py build/bin/stiction [--judge check_solution.py] [--results DIR] [--max-iterations 2000] [--strict]

Each case is solved by each solver under both laws, in f64 to 1e-6 and in f32 (from numbers rounded to f32 beforehand)
to 1e-3. Prints one line a failure and exits with 1 if there is one. Failures are that the command line crashed or
refused the batch, or that an output is missing. The same holds for a reaction or motion that is not finite, and broken
numbers that are not called `invalid_input`. Prints as well claims that do not hold, and with --strict takes them for
failures. Such a claim is a status `solved` of a problem that has no solution. Or the judge (without one: `stiction
verify`) finds more than the tolerance and its own rounding. To miss the tolerance and to say so is neither. With
--results it writes degenerate.csv and degenerate.md. Needs numpy and h5py; without them it exits with 77.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "arena"))

try:
    import h5py
    import numpy as np

    from environments import BOX, FREE, FRICTION, UNILATERAL, Environment, write_batch
    from judge import SLACK
    from measure import load_judge
except ImportError as missing:
    print(f"SKIPPED: {missing}")
    sys.exit(77)

SOLVERS = ["pgs", "npgs", "subspace", "nsgs", "jacobi", "apgd", "admm", "newton", "ipm", "lemke", "auto"]
TOLERANCE = {"f64": 1e-6, "f32": 1e-3}
CODES = ["solved", "max_iterations", "stalled", "numerical", "invalid_input", "unsupported", "rounding", "infeasible"]
FLAGS = ["non_finite_input", "negative_friction", "crossed_bounds", "negative_compliance", "bad_diagonal", "warm_start_rejected",
         "asymmetric", "contacts_dropped", "bad_mass", "over_capacity", "bad_structure", "unsupported_cone", "ray", "immovable"]
COLUMNS = ["law", "case", "solver", "precision", "status", "flags", "iterations", "residual"]


def system(name, matrix, b, kinds, sizes, row_param=None, compliance=None):
    matrix, b = np.atleast_2d(np.asarray(matrix, "f8")), np.asarray(b, "f8")
    n = len(b)
    full = matrix.reshape(n, n)
    return Environment(np.arange(n + 1) * n, np.tile(np.arange(n), n), full.ravel(), b,
                       np.zeros(n) if compliance is None else np.asarray(compliance, "f8"), np.asarray(kinds, "u1"),
                       np.concatenate(([0], np.cumsum(sizes))).astype(int),
                       np.zeros(n) if row_param is None else np.asarray(row_param, "f8"), name)


def rows_of(name, kind, matrix, b, bound=0.0):
    """One cone for each row."""
    return system(name, matrix, b, [kind] * len(b), [1] * len(b), [bound] * len(b))


def contacts(name, matrix, b, mu):
    """Friction cones of three rows; mu: one number, or two for the axes."""
    count = len(b) // 3
    return system(name, matrix, b, [FRICTION] * count, [3] * count, np.tile(np.concatenate(([0], np.broadcast_to(mu, 2))), count))


def body_contacts(name, points, velocity, mu, frames=None):
    """Contacts of one cube of 1 m and 1 kg at `points` from its centre; `frames`: normal and tangents as rows."""
    frames = [np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])] * len(points) if frames is None else frames
    jacobian = np.concatenate([np.hstack((frame, np.cross(point, frame))) for point, frame in zip(points, frames)])
    inverse_mass = np.diag([1, 1, 1, 6, 6, 6])
    return contacts(name, jacobian @ inverse_mass @ jacobian.T, jacobian @ velocity, mu)


def stack(name, masses, mu=0.5):
    """Point masses on one another and the ground, falling and drifting."""
    count, inverse = len(masses), 1 / np.asarray(masses, "f8")
    differences = np.eye(count) - np.eye(count, k=-1)  # contact i parts mass i and mass i - 1
    matrix = np.kron(differences @ np.diag(inverse) @ differences.T, np.eye(3))
    return contacts(name, matrix, np.kron(differences @ np.ones(count), [-0.05, 0.02, 0.01]), mu)


def cases():
    """(environment, its known state: "" nothing, "unsolvable" or "broken")"""
    grid = [(x, y, -0.5) for x in np.linspace(-0.5, 0.5, 8) for y in np.linspace(-0.5, 0.5, 8)]
    fall, slide = [0.02, 0.01, -0.05, 0, 0, 0], [0.2, 0.1, -0.05, 0, 0, 0.3]
    wedge = [np.array([[sx * 0.96, 0, 0.28], [0, 1, 0], [-0.28, 0, sx * 0.96]]) for sx in (1, -1)]
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    good = [
        body_contacts("64 contacts on one face", grid, fall, 0.5),
        body_contacts("64 contacts, sliding and turning", grid, slide, 0.5),
        body_contacts("64 contacts, mu 0", grid, fall, 0),
        body_contacts("64 contacts, mu 2", grid, slide, 2),
        body_contacts("one contact 64 times", grid[:1] * 64, fall, 0.5),
        body_contacts("4 contacts, mu 0 on one axis", [grid[i] for i in (0, 7, 56, 63)], slide, (0, 0.5)),
        body_contacts("wedge, mu 0", [(-0.5, 0, 0), (0.5, 0, 0)], fall, 0, wedge),
        body_contacts("wedge, mu 2", [(-0.5, 0, 0), (0.5, 0, 0)], fall, 2, wedge),
        stack("mass ratio 1e6, heavy above", [1, 1e6]),
        stack("mass ratio 1e6, heavy below", [1e6, 1]),
        stack("mass ratio 1e12, heavy above", [1, 1e12]),
        stack("mass ratio 1e12, heavy below", [1e12, 1]),
        stack("mass ratio 0, nothing below", [1e-20, 1]),
        stack("mass infinite above", [1, np.inf]),
        stack("8 masses, each 10 times the one below", 10.0 ** np.arange(8)),
        rows_of("free row of zeros", FREE, [[0]], [0]),
        rows_of("free rows, twice the same", FREE, np.ones((2, 2)), [1, 1]),
        rows_of("8 times the same unilateral row", UNILATERAL, np.ones((8, 8)), [-1] * 8),
        rows_of("LCP without a diagonal", UNILATERAL, [[0, 1], [1, 0]], [-1, -1]),
        rows_of("LCP, asymmetric and not copositive", UNILATERAL, [[1, 3], [-1, 1]], [-1, -1]),
        contacts("contact without tangential inertia, slipping", np.diag([1.0, 0, 0]), [-1, 1, 0], 0.5),
        rows_of("box of no width", BOX, [[2, 1], [1, 2]], [1, -1]),
        rows_of("box without bounds, singular", BOX, np.ones((2, 2)), [1, 1], np.inf),
        contacts("at rest, b = 0", np.eye(3), np.zeros(3), 0.5),
        contacts("A of 1e-30, b of 1e-20", 1e-30 * np.eye(3), [-1e-20, 1e-21, 0], 0.5),
        contacts("A of 1e30, b of 1e20", 1e30 * np.eye(3), [-1e20, 1e19, 0], 0.5),
        contacts("A of 1e-150, b of 1e150", 1e-150 * np.eye(3), [-1e150, 1e149, 0], 0.5),
        contacts("b below the normal numbers", np.eye(3), [-1e-310, 1e-311, 0], 0.5),
        system("no rows", np.zeros((0, 0)), [], [], []),
    ]
    unsolvable = [
        rows_of("LCP without a solution, semidefinite", UNILATERAL, pair, [-1, -1]),
        rows_of("LCP without a solution, indefinite", UNILATERAL, [[1, -2], [-2, 1]], [-1, -1]),
        contacts("squeezed between walls", np.kron(pair, np.eye(3)), [-1, 0.1, 0, -1, -0.1, 0], 0.5),
        rows_of("free rows that contradict", FREE, np.ones((2, 2)), [1, -1]),
        rows_of("free row of zeros that asks for motion", FREE, [[0]], [1]),
    ]
    broken = [
        contacts("NaN in b", np.eye(3), [-1, np.nan, 0], 0.5),
        contacts("infinity in A", np.diag([1, np.inf, 1]), [-1, 0, 0], 0.5),
        contacts("mu below 0", np.eye(3), [-1, 0, 0], -0.5),
        system("negative compliance", [[1]], [-1], [UNILATERAL], [1], None, [-1]),
    ]
    return [(case, known) for group, known in ((good, ""), (unsolvable, "unsolvable"), (broken, "broken")) for case in group]


def rounding(environment, reaction):
    """Rounding allowed to a judge in f64, over max|b|."""
    offsets, columns, values = environment.with_compliance()
    here = np.repeat(np.arange(environment.rows), np.diff(offsets))
    sums = np.bincount(here, np.abs(values * reaction[columns]), environment.rows) + np.abs(environment.b)
    return environment.rows * np.finfo("f8").eps * sums.max(initial=0) / max(np.abs(environment.b).max(initial=0), 1e-300)


def rounded(environment):
    """Numbers as f32 holds them, so that both precisions get the same; overflows stay."""
    def nearest(values):
        with np.errstate(over="ignore"):
            near = values.astype("f4").astype("f8")
        return np.where(np.isfinite(near), near, values)

    fields = {name: nearest(getattr(environment, name)) for name in ("values", "b", "compliance", "row_param")}
    return Environment(**(vars(environment) | fields))


class Bench:
    def __init__(self, arguments):
        self.arguments = arguments
        self.judge = load_judge(arguments.judge) if arguments.judge else None
        self.rows, self.failures, self.claims = [], [], []

    def residuals(self, batch, answer, solution, where, law, precision):
        """Residual of each environment, by the solver if there is no judge, after `verify` counted those above."""
        if self.judge:
            with h5py.File(batch) as file, np.errstate(all="ignore"):
                return self.judge(file, solution["lambda"].astype("f8"), law)
        tolerance = SLACK * TOLERANCE[precision]
        done = subprocess.run([self.arguments.stiction, "verify", str(batch), str(answer), "--law", law, "--json", "--tolerance",
                               repr(tolerance)], capture_output=True, text=True)
        above, silent = json.loads(done.stdout)["above"], int((solution["status"] != 0).sum())
        if above > silent:
            self.claims.append(f"{where}: {above} residuals above the tolerance, {silent} statuses say so")
        return solution["residual"]

    def solve(self, batch, environments, known, law, solver, precision):
        answer = batch.with_name("answer.h5")
        answer.unlink(missing_ok=True)
        command = [self.arguments.stiction, "solve", str(batch), "--solver", solver, "--law", law, "--precision", precision,
                   "--tolerance", repr(TOLERANCE[precision]), "--max-iterations", str(self.arguments.max_iterations),
                   "--threads", "1", "--isolate", "--quiet", "-o", str(answer)]
        where = f"law {law}, {solver}, {precision}"
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=600)
        except subprocess.TimeoutExpired:
            self.failures.append(f"{where}: no answer in 600 s")
            return
        if done.returncode not in (0, 1) or not answer.exists():
            self.failures.append(f"{where}: exit status {done.returncode} {done.stderr.strip()}")
            return
        with h5py.File(answer) as file:
            solution = {name: file[name][:] for name in ("lambda", "w", "status", "flags", "iterations", "residual")}
        residual = self.residuals(batch, answer, solution, where, law, precision)
        ends = np.cumsum([e.rows for e in environments])
        for i, (e, end) in enumerate(zip(environments, ends)):
            status = CODES[solution["status"][i]]
            flags = [name for bit, name in enumerate(FLAGS) if solution["flags"][i] >> bit & 1]
            self.rows.append(dict(law=law, case=e.name, solver=solver, precision=precision, status=status, flags=" ".join(flags),
                                  iterations=solution["iterations"][i], residual="-" if known[i] == "broken" else f"{residual[i]:.1e}"))
            said = f"{where}, {e.name}: {status}"
            for name in ("lambda", "w"):
                if not np.isfinite(solution[name][end - e.rows:end]).all():
                    self.failures.append(f"{said}, {name} is not finite")
            if known[i] == "broken" and status != "invalid_input":
                self.failures.append(f"{said} of broken numbers")
            if status == "solved" and known[i] == "unsolvable":
                self.claims.append(f"{said}, but it has no solution")
            elif status == "solved" and self.judge:
                reaction = solution["lambda"][end - e.rows:end].astype("f8")
                if not residual[i] <= SLACK * TOLERANCE[precision] + rounding(e, reaction):
                    self.claims.append(f"{said}, but the residual is {residual[i]:.1e}")

    def run(self):
        exact, known = zip(*cases())
        with tempfile.TemporaryDirectory() as folder:
            for law in ("coulomb", "convex"):
                for precision in TOLERANCE:
                    batch = pathlib.Path(folder, f"{law}_{precision}.h5")
                    environments = [rounded(e) if precision == "f32" else e for e in exact]
                    write_batch(batch, environments, law, "degenerate.py")
                    for solver in SOLVERS:
                        self.solve(batch, environments, known, law, solver, precision)


SHORT = {"solved": "", "max_iterations": "limit, ", "stalled": "stalled, ", "numerical": "numerical, "}


def cell(row):
    if row is None:
        return "no answer"
    if row["status"] in ("invalid_input", "unsupported"):
        return row["status"].replace("invalid_input", "invalid")
    ray = "ray, " if "ray" in row["flags"] else ""
    return f"{ray or SHORT[row['status']]}{row['residual']} ({row['iterations']})"


def write_tables(rows, claims, path):
    lines = ["# Degenerate input", "", "`bench/studies/degenerate.py`. A cell: how it ended (nothing: solved; limit: iterations used up; "
             "ray: Lemke's path left on one), the residual, the iterations. f64 to 1e-6, f32 to 1e-3.", ""]
    found = {(row["law"], row["precision"], row["case"], row["solver"]): row for row in rows}
    names = list(dict.fromkeys(row["case"] for row in rows))
    for law, precision in dict.fromkeys(key[:2] for key in found):
        lines += [f"## law {law}, {precision}", "", "| case | " + " | ".join(SOLVERS) + " |", "|---|" + "---|" * len(SOLVERS)]
        for name in names:
            lines.append(f"| {name} | " + " | ".join(cell(found.get((law, precision, name, s))) for s in SOLVERS) + " |")
        lines.append("")
    lines += ["## Claims that do not hold", "", *(f"- {claim}" for claim in claims or ["none"]), ""]
    path.write_text("\n".join(lines))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("--judge")
    parser.add_argument("--results", type=pathlib.Path)
    parser.add_argument("--max-iterations", type=int, default=2000)
    parser.add_argument("--strict", action="store_true")
    arguments = parser.parse_args()
    bench = Bench(arguments)
    bench.run()
    if arguments.results:
        with open(arguments.results / "degenerate.csv", "w", newline="") as file:
            table = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            table.writeheader()
            table.writerows(bench.rows)
        write_tables(bench.rows, bench.claims, arguments.results / "degenerate.md")
    for failure in bench.failures:
        print("FAILURE", failure)
    for claim in bench.claims:
        print("CLAIM", claim)
    print(f"{len(bench.rows)} answers, {len(bench.failures)} failures, {len(bench.claims)} claims that do not hold")
    return 1 if bench.failures or (arguments.strict and bench.claims) else 0


if __name__ == "__main__":
    sys.exit(main())
