#!/usr/bin/env python3
"""MuJoCo's constraint solvers and stiction on the same recorded robots, one thread, at equal judged residuals.

    PYTHONPATH=build/python bench/peers/robots.py [FILE ...] [--data DATA] [--judge tools/check_law.py] [--results DIR]
                            [--images DIR] [--goals 1e-4,1e-6] [--envs 64] [--repeat] [--seconds 0.4]
                            [--forms matrix,factor,jacobian] [--name robots]

Files are contact batches with J, M, v_free and row_target as recorded from MuJoCo; without any, the robots of
DATA/mujoco. mujoco_rows.py says how MuJoCo is made to solve them. No two environments are the same: of a
file up to --envs are taken. With --repeat they are repeated until there are so many. MuJoCo: Newton, CG and PGS, one environment after the other, in C. stiction: auto, npgs, subspace and newton, f32 and f64,
one call for all environments. Three forms define the inputs of both sides, and so the timed work:

    matrix     A. stiction solves; MuJoCo too (mj_fwdConstraint), whose Newton and CG know J and M's factor instead
    factor     J and M's factor: what MuJoCo's pipeline has when it calls its solver. stiction forms A; of MuJoCo's, PGS does
    jacobian   J and M: M is factored too, by both (mj_factorM)

Each solver takes the largest tolerance of its ladder at which 95 % of the environments are within the goal. The judge
decides. Cold starts begin at no reaction and at the free acceleration. Warm ones
begin from the solution of the same problem with every free acceleration changed by 5 % (normal noise). stiction gets
its reactions and, in the jacobian form, its accelerations, MuJoCo its accelerations. Solvers that take three times as long as the fastest of their form are left
out (auto in f64 always runs). The others that reach the goal then alternate, forth and back (A B C C B A). They
take --seconds of processor time at least three times. A ratio is MuJoCo's time over stiction's of one such turn, and
the tables have its median and quartiles. A solver that did not run for a goal does not run for a smaller one. Writes
NAME.csv, NAME.md and peers_NAME.png.
"""

import pathlib
import sys
import tempfile
import time

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "arena")]

import measure  # noqa: E402
import mujoco  # noqa: E402
import mujoco_rows  # noqa: E402
import systems  # noqa: E402
from arrays import jacobian_batch, matrix_batch  # noqa: E402
from judge import SLACK, law_of  # noqa: E402
from measure import load_judge  # noqa: E402

import stiction  # noqa: E402

ROBOTS = ["humanoid", "g1", "go1", "leap_hand", "franka_cube", "aloha_peg", "car", "22_humanoids"]
THEIR_LADDER = [10.0**-k for k in range(1, 17)]
OUR_LADDER = [1, 0.3, 0.1, 0.01]  # times the goal
SHARE, CHANGE, SLOWER = 0.95, 0.05, 3
FORMS = ("matrix", "factor", "jacobian")
OURS = [(solver, precision) for solver in ("auto", "npgs", "subspace", "newton") for precision in ("f64", "f32")]
COLUMNS = ["robot", "environments", "rows", "dofs", "start", "goal", "form", "solver", "precision", "us", "residual_p95", "peer",
           "peer_tolerance", "peer_us", "peer_residual_p95", "ratio_q1", "ratio", "ratio_q3", "turns"]


class Robot:
    """The problems of a file, and where every solver starts. repeat: they are repeated until there are `envs`."""

    def __init__(self, path, envs, judge, repeat=False):
        self.path, self.name, self.judge = path, path.stem, judge
        recorded = systems.read(path)
        self.recorded, self.first = len(recorded), recorded[:envs]
        self.systems = self.first * (-(-envs // len(self.first)) if repeat else 1)
        self.copies = len(self.systems) // len(self.first)
        rng = np.random.default_rng(11)
        moved = [s.v_free * (1 + CHANGE * rng.standard_normal(len(s.v_free))) for s in self.first]
        near = matrix_batch(self.first, "f64", b=[s.J @ v - s.target for s, v in zip(self.first, moved)])
        reactions = stiction.Solver(tolerance=1e-9, max_iterations=10000, threads=1).solve(near).lambda_
        pieces = np.split(reactions, np.cumsum([s.rows for s in self.first])[:-1])
        self.reactions = np.tile(reactions, self.copies)
        self.accelerations = np.tile([v + np.linalg.solve(s.M, s.J.T @ x) for s, v, x in zip(self.first, moved, pieces)],
                                     (self.copies, 1))
        self.checked, self.batches = matrix_batch(self.first, "f64"), {}

    def batch(self, form, precision):
        key = form, precision
        if key not in self.batches:
            self.batches[key] = (matrix_batch(self.systems, precision) if form == "matrix" else
                                 jacobian_batch(self.systems, precision, form == "factor"))
        return self.batches[key]

    def error(self, reactions):
        """95th percentile of the residuals of the first copy."""
        reactions = np.asarray(reactions[:len(self.checked.b)], "f8")
        if self.judge is None or len(self.first) < self.recorded:
            found = stiction.verify(self.checked, reactions)[:, 0]
        else:
            with h5py.File(self.path) as batch:
                found = self.judge(batch, reactions, law_of(batch))
        return float(np.quantile(found, SHARE, method="higher"))


class Ours:
    def __init__(self, robot, form, solver, precision, warm):
        self.form, self.solver, self.precision = form, solver, precision
        self.batch = robot.batch(form, precision)
        self.start = robot.reactions.astype(self.batch.dtype) if warm else None
        self.moving = robot.accelerations.astype(self.batch.dtype).reshape(-1) if warm and form == "jacobian" else None
        self.solution = stiction.Solution.empty(self.batch)

    def ladder(self, goal):
        return [goal * factor for factor in OUR_LADDER]

    def tune(self, tolerance):
        self.tolerance = tolerance
        self.machine = stiction.Solver(solver=self.solver, tolerance=tolerance, max_iterations=10000, threads=1)

    def run(self):
        """Seconds of a solve."""
        begin = time.thread_time()
        self.machine.solve(self.batch, out=self.solution, warm_start=self.start, warm_velocities=self.moving)
        return time.thread_time() - begin, 0.0, 0.0

    def reactions(self):
        return self.solution.lambda_


class Theirs:
    def __init__(self, robot, peer, solver, warm):
        self.robot, self.peer, self.solver, self.warm = robot, peer, solver, warm
        self.form, self.precision = "peer", "f64"

    def ladder(self, goal):
        return THEIR_LADDER

    def tune(self, tolerance):
        self.tolerance = tolerance

    def run(self):
        """Seconds of the solve, of what PGS alone needs before, of factoring M."""
        self.peer.choose(self.solver, self.tolerance, self.warm)
        self.peer.start(self.robot.accelerations)
        steps = [self.peer.factor] + [self.peer.project] * (self.solver == "PGS") + [self.peer.solve]
        clock = [time.thread_time()]
        for step in steps:
            step()
            clock.append(time.thread_time())
        return clock[-1] - clock[-2], clock[-2] - clock[1], clock[1] - clock[0]

    def reactions(self):
        return self.peer.answer()[0]


def qualify(robot, entrant, goal, limit):
    """Sets the largest tolerance that reaches the goal; False if none does, or not within `limit` seconds a solve."""
    for tolerance in entrant.ladder(goal):
        entrant.tune(tolerance)
        try:
            spent = sum(entrant.run())
        except stiction.Error:
            return False
        entrant.spent, entrant.error = spent, robot.error(entrant.reactions())
        if entrant.error <= SLACK * goal:
            return True
        if spent > limit:
            return False
    return False


def contenders(entrants):
    """Without those that took more than three times as long as the fastest of their form, or of MuJoCo's."""
    least = {}
    for one in entrants:
        least[one.form] = min(least.get(one.form, np.inf), one.spent)
    return [one for one in entrants if one.spent <= SLOWER * least[one.form] or (one.solver, one.precision) == ("auto", "f64")]


def turns(entrants, seconds):
    """(turns, entrants, 3): mean seconds of each one's two runs of every turn."""
    table, begin = [], time.process_time()
    while len(table) < 3 or (len(table) < 25 and time.process_time() - begin < seconds):
        forth = [entrant.run() for entrant in entrants]
        back = [entrant.run() for entrant in entrants[::-1]][::-1]
        table.append(np.mean([forth, back], axis=0))
    return np.array(table)


def race(robot, functions, arguments):
    peer = mujoco_rows.Peer(functions, robot.systems)
    rows = []
    for warm in (False, True):
        entrants = [Ours(robot, form, *which, warm) for form in arguments.forms for which in OURS]
        entrants += [Theirs(robot, peer, solver, warm) for solver in mujoco_rows.SOLVERS]
        for goal in arguments.goals:
            entrants = contenders([one for one in entrants if qualify(robot, one, goal, arguments.limit)])
            if len({isinstance(one, Ours) for one in entrants}) < 2:
                print(f"{robot.name}: no solver on one side reaches {goal:g}", file=sys.stderr)
                break
            spent = turns(entrants, arguments.seconds) * 1e6 / len(robot.systems)
            rows += list(pairs(robot, entrants, spent, "warm" if warm else "cold", goal))
    peer.close()
    return rows


def pairs(robot, entrants, spent, start, goal):
    """A row of the table for each of ours against each of theirs."""
    for i, our in enumerate(entrants):
        for j, their in enumerate(entrants):
            if not isinstance(our, Ours) or not isinstance(their, Theirs):
                continue
            theirs = spent[:, j, :1 + FORMS.index(our.form)].sum(axis=1)
            low, middle, high = np.quantile(theirs / spent[:, i, 0], (0.25, 0.5, 0.75))
            yield dict(robot=robot.name, environments=len(robot.systems), rows=np.mean([s.rows for s in robot.first]),
                       dofs=len(robot.first[0].M), start=start, goal=goal, form=our.form, solver=our.solver,
                       precision=our.precision, us=np.median(spent[:, i, 0]), residual_p95=our.error, peer=their.solver,
                       peer_tolerance=their.tolerance, peer_us=np.median(theirs), peer_residual_p95=their.error, ratio_q1=low,
                       ratio=middle, ratio_q3=high, turns=len(spent))


def best(rows, **wanted):
    """The row of the fastest of ours against the fastest of theirs."""
    own = [row for row in rows if all(row[key] == value for key, value in wanted.items())]
    return min(own, key=lambda row: (row["us"], row["peer_us"])) if own else None


def told(rows):
    """Rows of report()'s table. For each robot, form, start and goal they are the fastest of ours against each of
    theirs, and auto in f64."""
    races = {}
    for row in rows:
        races.setdefault(tuple(row[name] for name in ("robot", "form", "start", "goal")), []).append(row)
    for race_rows in races.values():
        fastest, auto = best(race_rows), best(race_rows, solver="auto", precision="f64")
        yield from (row for row in race_rows
                    if row is auto or all(row[name] == fastest[name] for name in ("solver", "precision")))


def said(row):
    if row is None:
        return "-"
    return (f"{row['peer']} {row['peer_us']:.3g}, {row['solver']} {row['precision']} {row['us']:.3g}: **{row['ratio']:.2f}** "
            f"({row['ratio_q1']:.2f}-{row['ratio_q3']:.2f})")


def report(rows, goals, path):
    names = list(dict.fromkeys(row["robot"] for row in rows))
    lines = ["# MuJoCo and stiction on recorded robots", "",
             f"`bench/peers/robots.py`; {measure.machine_name()}, one thread, processor time; MuJoCo {mujoco.__version__}, stiction "
             f"{stiction.__version__}. A cell: MuJoCo's fastest solver and its microseconds of an environment, stiction's fastest "
             "and its, then the ratio (above 1: stiction is faster), median and quartiles over turns. `auto f64`: the same "
             "without a choice of ours. -: one side does not reach the residual.", ""]
    for form, start in [(form, start) for form in dict.fromkeys(row["form"] for row in rows) for start in ("cold", "warm")]:
        lines += [f"## {form} form, {start} start", "", "| robot | rows, dofs | " + " | ".join(
            f"{goal:g} | {goal:g}, auto f64" for goal in goals) + " |", "|---|---|" + "---|" * (2 * len(goals))]
        ratios = []
        for name in names:
            cells = []
            for goal in goals:
                wanted = dict(robot=name, form=form, start=start, goal=goal)
                for row in (best(rows, **wanted), best(rows, solver="auto", precision="f64", **wanted)):
                    cells.append(said(row))
                    ratios.append(np.nan if row is None else row["ratio"])
            one = next(row for row in rows if row["robot"] == name)
            lines.append(f"| {name} | {one['rows']:.0f}, {one['dofs']} | " + " | ".join(cells) + " |")
        middle = [np.median(column[np.isfinite(column)]) if np.isfinite(column).any() else np.nan
                  for column in np.reshape(ratios, (len(names), -1)).T]
        lines += ["| median | | " + " | ".join(f"{value:.2f}" for value in middle) + " |", ""]
    path.write_text("\n".join(lines))


def draw(rows, goals, path):
    """MuJoCo's time over ours, fastest against fastest."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(row["robot"] for row in rows))
    figure, axes = plt.subplots(1, len(goals), figsize=(6 * len(goals), 4), sharey=True, squeeze=False)
    for axis, goal in zip(axes[0], goals):
        for shift, (start, form, colour) in enumerate([("cold", "factor", "tab:blue"), ("cold", "matrix", "tab:cyan"),
                                                       ("cold", "jacobian", "tab:green"), ("warm", "factor", "tab:red"),
                                                       ("warm", "matrix", "tab:orange"), ("warm", "jacobian", "tab:olive")]):
            found = [best(rows, robot=name, form=form, start=start, goal=goal) for name in names]
            if not any(found):
                continue
            low, ratio, high = (np.array([np.nan if row is None else row[key] for row in found])
                                for key in ("ratio_q1", "ratio", "ratio_q3"))
            given = {"matrix": "A", "factor": "J and the factor of M", "jacobian": "J and M"}[form]
            axis.errorbar(np.arange(len(names)) + 0.12 * (shift - 2.5), ratio, [ratio - low, high - ratio], fmt="o", color=colour,
                          capsize=2, label=f"{start}, {given} given")
        axis.axhline(1, color="black", linewidth=0.8)
        axis.set(title=f"residual {goal:g}", yscale="log")
        axis.set_xticks(range(len(names)), names, rotation=30, ha="right")
        axis.grid(alpha=0.3)
    axes[0][0].set_ylabel("MuJoCo's time over stiction's")
    axes[0][-1].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser, files_of = measure.race_arguments(__doc__, ROBOTS)
    parser.add_argument("--envs", type=int, default=64)
    parser.add_argument("--repeat", action="store_true")
    parser.add_argument("--forms", type=lambda text: text.split(","), default=list(FORMS))
    parser.add_argument("--name", default="robots", help="of the files written")
    parser.add_argument("--seconds", type=float, default=0.4, help="processor time of the turns of one start and goal")
    parser.add_argument("--limit", type=float, default=0.5, help="seconds after which a solve is not asked for more")
    arguments = parser.parse_args()
    judge = load_judge(arguments.judge)
    files = files_of(arguments)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        functions = mujoco_rows.build(folder)
        if functions is None or not files:
            sys.exit("no C compiler, no headers of MuJoCo, or no recorded robots: nothing to compare")
        for path in files:
            begin = time.process_time()
            rows += race(Robot(path, arguments.envs, judge, arguments.repeat), functions, arguments)
            print(f"{path.stem}: {time.process_time() - begin:.1f} s", file=sys.stderr, flush=True)
    measure.write_table(arguments.results / f"{arguments.name}.csv", ["bench/peers/robots.py", f"machine: {measure.machine_name()}",
                        f"MuJoCo {mujoco.__version__}, stiction {stiction.__version__}"], COLUMNS, measure.rounded(told(rows)))
    report(rows, arguments.goals, arguments.results / f"{arguments.name}.md")
    draw(rows, arguments.goals, arguments.images / f"peers_{arguments.name}.png")


if __name__ == "__main__":
    main()
