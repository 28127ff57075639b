#!/usr/bin/env python3
"""How stiction's time grows: with environments, contacts and threads; its tails; what a warm start saves.

    PYTHONPATH=build/python bench/peers/scaling.py STICTION [--data DATA] [--judge tools/check_law.py] [--results DIR]
                            [--images DIR] [--seed 7] [--most 65536] [--quick]

environments   20 sweeps of 8 contacts, 1 to 65536 environments, one thread and two: from A in f32 and f64, from bodies
contacts       20 sweeps of 1 to 256 contacts: `stack` of boxes (A block tridiagonal), `face` (one cube, A full), `bodies`
tails          generated scenes and recorded robots to 1e-4 by auto in f64, each environment in a separate call
warm           consecutive steps in DATA/sequences: iterations and time to 1e-2 and 1e-3 from zero and from the step before.
               Both have as many contacts and both solve, by the judge. gain_iterations: median over steps of
               (cold + 1) / (warm + 1) iterations; gain_total, gain_time: all steps' iterations and time together

Sweeps are fixed by tolerance 0. Time is processor time for one thread and the wall clock for two. It is the least of
the calls that fit into a quarter of a second, three at least. An exponent is the slope of a least-squares line through
logarithms of time over the tail that the report names, with its standard error. Writes scaling.csv, tails.csv,
warm.csv, scaling.md and peers_scaling.png.
"""

import argparse
import functools
import itertools
import pathlib
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "studies")]

import measure  # noqa: E402
import problems  # noqa: E402
import slopes  # noqa: E402
from arrays import matrix_batch  # noqa: E402
from environments import read_environments  # noqa: E402
from roster import JUDGE, SLACK, law_of, load_judge  # noqa: E402

import stiction  # noqa: E402

SWEEPS, DISTINCT = 20, 16
PRECISION = {"f32": np.float32, "f64": np.float64}
SCENES = {"stack": 4, "grasp": 0, "walker": 0, "mixed": 0}  # size, 0: the scene's own
ROBOTS = ["humanoid", "g1", "leap_hand"]
SEQUENCES = ["stack5_mu05", "heap12_mu07"]
COLUMNS = ["series", "form", "precision", "threads", "contacts", "environments", "us_per_env", "ns_per_contact_sweep", "clock",
           "calls", "ratio_q1", "ratio", "ratio_q3"]
TAIL_COLUMNS = ["set", "environments", "solved", "iterations_p50", "iterations_p95", "iterations_max", "us_p50", "us_p95", "us_max"]
WARM_COLUMNS = ["sequence", "solver", "goal", "steps", "iterations_cold", "iterations_warm", "gain_iterations", "gain_q1", "gain_q3",
                "gain_total", "gain_time"]


@functools.cache
def problem(family, contacts, index, seed):
    rng = np.random.default_rng([seed, index])
    if family == "face":
        return problems.face(contacts, rng)
    return problems.first_contacts(problems.cubes(np.ones(-(-contacts // 4)), rng), contacts)


def padded_batch(family, contacts, envs, precision, seed):
    """Dense matrices, the first DISTINCT of which differ."""
    few = [problem(family, contacts, i, seed) for i in range(min(DISTINCT, envs))]
    repeat = -(-envs // len(few))
    A = np.tile(np.array([A for A, *_ in few], PRECISION[precision]), (repeat, 1, 1))[:envs]
    b = np.tile(np.array([b for _, b, *_ in few], PRECISION[precision]), (repeat, 1))[:envs]
    return stiction.Batch.from_delassus(A, b, mu=0.5, law="coulomb")


def stored_batch(family, contacts, envs, precision, seed, folder):
    """Stored entries, as a file has them."""
    path = problems.write(pathlib.Path(folder, "some.h5"), "coulomb",
                          [problem(family, contacts, i, seed) for i in range(min(DISTINCT, envs))])
    some = read_environments(path)
    return matrix_batch([some[i % len(some)] for i in range(envs)], precision, "coulomb")


def body_batch(contacts, envs, precision, seed, edge=0.2):
    """The stack without a matrix."""
    kind, boxes = PRECISION[precision], -(-contacts // 4)
    rng = np.random.default_rng(seed)
    corners = 0.5 * edge * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    below, above = np.zeros((contacts, 3)), np.zeros((contacts, 3))
    for c in range(contacts):
        above[c] = *corners[c % 4], -0.5 * edge
        below[c] = *corners[c % 4], 0.5 * edge
    lower = np.arange(contacts) // 4 - 1

    def every(array, kind=kind):
        return np.ascontiguousarray(np.broadcast_to(array, (envs, *np.shape(array))), kind)

    twist = 0.2 * problems.WEIGHT * rng.standard_normal((min(envs, DISTINCT), boxes, 6))
    inertia = 6 / edge**2
    return stiction.Batch.from_bodies(
        every(np.ones(boxes)), every(np.tile([inertia, 0, 0, inertia, 0, inertia], (boxes, 1))),
        np.tile(twist, (-(-envs // len(twist)), 1, 1))[:envs].astype(kind), every(lower, "i4"), every(lower + 1, "i4"), every(below),
        every(above), every(np.tile([0, 0, 1], (contacts, 1))), every(np.full(contacts, 0.5)), every(np.zeros(contacts)),
        twist_change=every(np.tile([0, 0, -problems.WEIGHT, 0, 0, 0], (boxes, 1))))


def timed(batch, threads=(1,), sweeps=SWEEPS, seconds=0.25, turns=3):
    """Seconds of calls by number of threads: at least `turns` turns through all numbers, forth and back."""
    solvers = {n: stiction.Solver(solver="pgs", tolerance=0, max_iterations=sweeps, threads=n, stall_window=0) for n in threads}
    solution = solvers[threads[0]].solve(batch)
    spent = {n: [] for n in threads}
    while len(spent[threads[0]]) < turns or sum(map(sum, spent.values())) < seconds * len(threads):
        for n in threads[::-1] if len(spent[threads[0]]) % 2 else threads:
            clock = time.thread_time if n == 1 else time.perf_counter
            begin = clock()
            solvers[n].solve(batch, out=solution)
            spent[n].append(clock() - begin)
    return spent


def points(series, form, precision, contacts, envs, batch, threads=(1,), turns=3):
    """A row for each number of threads; of several, each with the ratio of one thread's time in the same turn to its own."""
    spent = timed(batch, threads, turns=turns)
    for n, times in spent.items():
        row = dict(series=series, form=form, precision=precision, threads=n, contacts=contacts, environments=envs,
                   us_per_env=1e6 * min(times) / envs, ns_per_contact_sweep=1e9 * min(times) / (envs * contacts * SWEEPS),
                   clock="processor" if n == 1 else "wall", calls=len(times))
        quartiles = np.quantile(np.array(spent[1]) / times, (0.25, 0.5, 0.75))
        yield row | dict(zip(("ratio_q1", "ratio", "ratio_q3"), quartiles if n > 1 else ("", "", "")))


def environment_series(arguments):
    counts = [4**k for k in range(9) if 4**k <= arguments.most]
    for form, precision in (("matrix", "f32"), ("matrix", "f64"), ("bodies", "f32")):
        for envs in counts:
            if form == "matrix":
                batch = padded_batch("stack", 8, envs, precision, arguments.seed)
            else:
                batch = body_batch(8, envs, precision, arguments.seed)
            # What a second thread is worth is said of the largest batch, and depends on what else runs.
            yield from points("environments", form, precision, 8, envs, batch, (1, 2) if envs >= 16 else (1,),
                              turns=11 if envs == counts[-1] else 3)


def contact_series(arguments, folder):
    for contacts in [2**k for k in range(9)][:4 if arguments.quick else 9]:
        few = int(max(16, min(1024, 2e6 / (3 * contacts) ** 2)))
        many = max(16, 8192 // contacts)
        for form, envs, batch in (("stack", few, stored_batch("stack", contacts, few, "f32", arguments.seed, folder)),
                                  ("face", few, padded_batch("face", contacts, few, "f32", arguments.seed)),
                                  ("bodies", many, body_batch(contacts, many, "f32", arguments.seed))):
            yield from points("contacts", form, "f32", contacts, envs, batch)


def alone(environments, law, solver, warm=None):
    """(iterations, least microseconds, reactions, solved) of each environment in a separate call."""
    for i, environment in enumerate(environments):
        batch = matrix_batch([environment], "f64", law)
        guess = None if warm is None else warm[i]
        best = np.inf
        for _ in range(3):
            begin = time.thread_time()
            answer = solver.solve(batch, warm_start=guess)
            best = min(best, time.thread_time() - begin)
            if best > 0.05:
                break
        yield int(answer.status["iterations"][0]), 1e6 * best, np.array(answer.lambda_), bool(answer.solved[0])


def tails(arguments, folder):
    """Rows of the table and every environment's microseconds, by set."""
    files = []
    for scene, size in SCENES.items():
        path = pathlib.Path(folder, f"{scene}.h5")
        subprocess.run([arguments.stiction, "generate", scene, "--size", str(size), "--envs", "16" if arguments.quick else "128",
                        "--seed", str(arguments.seed), "-o", str(path), "--quiet"], check=True)
        files.append(path)
    files += [path for path in (arguments.data / "mujoco" / f"{name}.h5" for name in ROBOTS) if path.is_file()]
    solver = stiction.Solver(solver="auto", tolerance=1e-4, max_iterations=10000, threads=1)
    for path in files:
        with h5py.File(path) as batch:
            law = law_of(batch)
        environments = [e for e in read_environments(path) if e.rows]
        iterations, microseconds, _, solved = map(np.array, zip(*((i, u, 0, s) for i, u, _, s in alone(environments, law, solver))))
        row = dict(set=path.stem, environments=len(environments), solved=int(solved.sum()))
        for name, values in (("iterations", iterations), ("us", microseconds)):
            row |= {f"{name}_p50": np.quantile(values, 0.5), f"{name}_p95": np.quantile(values, 0.95), f"{name}_max": values.max()}
        yield row, microseconds


def warm_starts(arguments, judge):
    for name in SEQUENCES:
        path = arguments.data / "sequences" / f"{name}.h5"
        if not path.is_file():
            print(f"{name}: not there, left out", file=sys.stderr)
            continue
        environments = read_environments(path)
        with h5py.File(path) as batch:
            law, steps = law_of(batch), batch["step"][:]
        rows = [environment.rows for environment in environments]
        after = [i for i in range(1, len(rows)) if rows[i] == rows[i - 1] > 0 and steps[i] > steps[i - 1]]
        for solver in ("npgs", "auto"):
            for goal in (1e-2, 1e-3):
                machine = stiction.Solver(solver=solver, tolerance=goal, max_iterations=10000, threads=1)
                cold = list(alone(environments, law, machine))
                warm = list(alone([environments[i] for i in after], law, machine, [cold[i - 1][2] for i in after]))
                good = judged(path, environments, [answer[2] for answer in cold], law, judge, machine) <= SLACK * goal
                answers = [answer[2] for answer in cold]
                for i, answer in zip(after, warm):
                    answers[i] = answer[2]
                good &= judged(path, environments, answers, law, judge, machine) <= SLACK * goal
                both = [(cold[i], answer) for i, answer in zip(after, warm) if good[i] and good[i - 1]]
                if not both:
                    continue
                was, now = (np.array([pair[k][:2] for pair in both], float) for k in (0, 1))
                gain = (was[:, 0] + 1) / (now[:, 0] + 1)
                low, middle, high = np.quantile(gain, (0.25, 0.5, 0.75))
                total, time_saved = was.sum(axis=0) / now.sum(axis=0)
                yield dict(sequence=name, solver=solver, goal=goal, steps=len(both), iterations_cold=np.median(was[:, 0]),
                           iterations_warm=np.median(now[:, 0]), gain_iterations=middle, gain_q1=low, gain_q3=high,
                           gain_total=total, gain_time=time_saved)


def judged(path, environments, reactions, law, judge, machine):
    if judge:
        # The judge divides by the diagonal of A, which is denormal in some rows of the sequences.
        with h5py.File(path) as batch, np.errstate(over="ignore"):
            return judge(batch, np.concatenate(reactions), law)
    return stiction.verify(matrix_batch(environments, "f64", law), np.concatenate(reactions))[:, 0]


def write(arguments, rows, tail_rows, warm_rows):
    comments = measure.header(arguments.stiction, "peers/scaling.py")[:-1] + [f"seed {arguments.seed}"]

    def text(value, digits):
        return f"{value:.{digits}g}" if isinstance(value, (float, np.floating)) else str(value)

    tables = (("scaling", COLUMNS, rows), ("tails", TAIL_COLUMNS, tail_rows), ("warm", WARM_COLUMNS, warm_rows))
    for name, columns, table in tables:
        measure.write_table(arguments.results / f"{name}.csv", comments, columns,
                            [{key: text(value, 4) for key, value in row.items()} for row in table])
    lines = ["# How stiction's time grows", "", f"`bench/peers/scaling.py`, seed {arguments.seed}; {measure.machine_name()}.", "",
             f"Exponents of time, by least squares from {slopes.SERIES['environments']} environments and "
             f"{slopes.SERIES['contacts']} contacts on.", "",
             "| series | exponent | standard error |", "|---|---|---|"]
    lines += [f"| {series}, {form} {precision}, threads {threads} | {slope:.3f} | {error:.3f} |"
              for series, form, precision, threads, slope, error in slopes.exponents(rows)]
    lines += ["", "Two threads: processor time of one thread over wall-clock time of two in the same turn, median and quartiles (nothing else "
              "may run).", "", "| form | environments | times faster |", "|---|---|---|"]
    lines += [f"| {form} {precision} | {envs} | {ratio} |" for form, precision, envs, ratio in slopes.second_thread(rows)]
    for title, columns, table in (("Each environment in a call of its own, to 1e-4, auto, f64", TAIL_COLUMNS, tail_rows),
                                  ("From the step before", WARM_COLUMNS, warm_rows)):
        lines += ["", f"{title}.", "", "| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
        lines += ["| " + " | ".join(text(row[column], 3) for column in columns) + " |" for row in table]
    (arguments.results / "scaling.md").write_text("\n".join(lines) + "\n")


def draw(rows, tail_times, warm_rows, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(12, 9))
    for axis, series in zip(axes[0], slopes.SERIES):
        for form, precision, threads, sizes, microseconds in slopes.of_series(rows, series):
            axis.plot(sizes, microseconds, "-" if threads == 1 else ":", marker="o", markersize=3,
                      label=f"{form} {precision}" + ("" if threads == 1 else f", {threads} threads"))
        axis.set(xscale="log", yscale="log", xlabel=series, ylabel=f"microseconds of an environment, {SWEEPS} sweeps")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    axis = axes[1][0]
    for name, values in tail_times.items():
        axis.step(np.sort(values), np.arange(1, len(values) + 1) / len(values), where="post", label=name)
    axis.set(xscale="log", xlabel="microseconds of an environment solved alone, to 1e-4", ylabel="share of environments", ylim=(0, 1))
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
    axis = axes[1][1]
    for i, row in enumerate(warm_rows):
        axis.barh(i, row["gain_iterations"], color="tab:blue" if row["goal"] == 1e-2 else "tab:cyan",
                  xerr=[[row["gain_iterations"] - row["gain_q1"]], [row["gain_q3"] - row["gain_iterations"]]], capsize=2)
    axis.set_yticks(range(len(warm_rows)), [f"{row['sequence']} {row['solver']} {row['goal']:g}" for row in warm_rows], fontsize=8)
    axis.axvline(1, color="black", linewidth=0.8)
    axis.set(xscale="log", xlabel="iterations from zero over those from the step before, median and quartiles")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stiction")
    parser.add_argument("--data", type=pathlib.Path, default=measure.ROOT.parent / "shared" / "data")
    parser.add_argument("--judge", default=JUDGE)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--images", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--most", type=int, default=65536, help="environments of the largest batch")
    parser.add_argument("--quick", action="store_true", help="few points, to see that it runs")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.most = min(arguments.most, 256)
    judge = load_judge(arguments.judge)
    with tempfile.TemporaryDirectory() as folder:
        rows = []
        for row in itertools.chain(environment_series(arguments), contact_series(arguments, folder)):
            rows.append(row)
            print("{series}: {form} {precision}, {contacts} contacts, {environments} environments, threads {threads}: "
                  "{us_per_env:.4g} us".format(**row), file=sys.stderr, flush=True)
        tail_rows, tail_times = [], {}
        for row, microseconds in tails(arguments, folder):
            tail_rows.append(row)
            tail_times[row["set"]] = microseconds
    warm_rows = list(warm_starts(arguments, judge))
    write(arguments, rows, tail_rows, warm_rows)
    draw(rows, tail_times, warm_rows, arguments.images / "peers_scaling.png")


if __name__ == "__main__":
    main()
