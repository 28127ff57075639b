#!/usr/bin/env python3
"""stiction on a GPU against MJX, MuJoCo Warp and batched PyTorch, on recorded robots, at equal judged residuals.

    PYTHONPATH=build/python bench/peers/gpu.py [FILE ...] [--device cuda] [--data DATA] [--judge tools/check_law.py] [--results DIR]
                         [--images DIR] [--goals 1e-4,1e-6] [--envs 64,1024,8192,32768] [--peers torch,mjx,warp] [--seconds 1]

Files are contact batches under the convex law with J, M, v_free and row_target, as for robots.py. Their environments
are filled up to the same cones (padded.py) and repeated. Every peer gets the same arrays, in the memory of the device
before the clock starts, and leaves the answer there:

    torch   PGS, APGD and ADMM written for this (torch_peers.py), given A; on a GPU also with a chunk captured as a CUDA graph
    mjx     MJX's Newton and CG (mjx_peer.py), given J and M
    warp    MuJoCo Warp's Newton and CG (warp_peer.py), given J and M; f32
    ours    auto, npgs and newton, given A (form matrix) or J and M's factor (form factor), which is what is raced with MJX and Warp

Each takes the largest tolerance of its ladder at which 95 % of the recorded environments are judged within the goal.
It is found once with the smallest batch. Then all alternate, forth and back, for --seconds three times at least. A
ratio is the peer's time over stiction's in one turn. Median and quartiles are in the tables. Cold starts. Clocks: CUDA
events around what is queued (torch, warp, ours); for MJX, whose streams are its own, the wall until its answer is
there. Compiling, capturing and the first call are not counted.

The second table has stiction alone on the largest batch. It compares the device with the CPU on two threads, wall
clock, and says whether the bits are the same. A peer that is not installed is left out. --device cpu runs all of it on
the CPU, processor time of one thread: a check of the programs, not a comparison of devices. Writes gpu.csv,
gpu_fallback.csv, gpu.md and peers_gpu.png.
"""

import importlib
import pathlib
import sys
import time

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "arena")]

import measure  # noqa: E402
import systems  # noqa: E402
import torch  # noqa: E402
import torch_peers  # noqa: E402
from padded import Padded  # noqa: E402
from judge import SLACK, law_of  # noqa: E402
from measure import load_judge  # noqa: E402

import stiction  # noqa: E402

ROBOTS = ["humanoid", "g1", "go1", "leap_hand", "franka_cube", "aloha_peg", "car"]
SHARE = torch_peers.SHARE
LADDER = [30, 10, 3, 1, 0.3, 0.1, 0.03, 0.01]  # times the goal, where a residual like the judge's is computed
POWERS = [10.0**-k for k in range(2, 16)]  # where gradients and improvements are
SOLVERS = ("auto", "npgs", "newton")
COLUMNS = ["robot", "environments", "rows", "goal", "form", "solver", "precision", "us", "residual_p95", "peer", "peer_precision",
           "peer_tolerance", "peer_us", "peer_residual_p95", "clock", "ratio_q1", "ratio", "ratio_q3", "turns"]
FALLBACK_COLUMNS = ["robot", "environments", "solver", "precision", "device_us", "cpu_us", "ratio_q1", "ratio", "ratio_q3", "same_bits"]


class Robot:
    """The problems of a file and their judge."""

    def __init__(self, path, judge, device):
        self.path, self.name, self.judge, self.device = path, path.stem, judge, device
        with h5py.File(path) as batch:
            if law_of(batch) != "convex":
                raise ValueError(f"{path}: the peers know the convex law alone")
        self.first = systems.read(path)
        self.padded = Padded(self.first)

    def error(self, reactions):
        """95th percentile of the residuals of the first copy, of as much of it as there is."""
        found = self.padded.own(np.asarray(reactions[:len(self.first)]))
        if self.judge:
            with h5py.File(self.path) as batch:
                residual = self.judge(batch, found, "convex")
        else:
            from arrays import matrix_batch
            residual = stiction.verify(matrix_batch(self.first, "f64"), found)[:, 0]
        return float(np.quantile(residual, SHARE, method="higher"))


class Ours:
    package, clock = "stiction", "events"

    def __init__(self, robot, given, device, form, solver, precision):
        self.form, self.name, self.precision, self.device = form, solver, precision, device
        more = dict(cones=robot.padded.cones(), law="convex", mu=given.friction, R=given.R, lo=-given.bound, hi=given.bound)
        if form == "matrix":
            self.batch = stiction.Batch.from_delassus(given.A, given.b, **more)
        else:
            self.batch = stiction.Batch.from_jacobian(given.J, given.factor, given.v_free, given.target, mass_form="factor", **more)
        self.solution = stiction.Solution.empty(self.batch)

    def ladder(self, goal):
        return [goal * factor for factor in LADDER if factor <= 1]

    def tune(self, tolerance):
        self.tolerance = tolerance
        self.machine = stiction.Solver(device=self.device, solver=self.name, tolerance=tolerance, max_iterations=10000, threads=1)

    def run(self):
        self.machine.solve(self.batch, out=self.solution)

    def reactions(self):
        self.solution.synchronize()
        return self.solution.lambda_.double().cpu().numpy()


class Theirs:
    """A peer: how it is made, which ladder it has and whose clock."""

    form = "peer"

    def __init__(self, package, name, precision, make, powers, clock="events"):
        self.package, self.name, self.precision, self.clock, self.powers = package, name, precision, clock, powers
        self.peer = make()

    def ladder(self, goal):
        return POWERS if self.powers else [goal * factor for factor in LADDER]

    def tune(self, tolerance):
        self.tolerance = tolerance

    def run(self):
        self.answer = self.peer.solve(self.tolerance)

    def reactions(self):
        answer = self.answer.cpu() if isinstance(self.answer, torch.Tensor) else self.answer
        return answer.numpy() if hasattr(answer, "numpy") else np.asarray(answer)


def optional(name):
    try:
        return importlib.import_module(name)
    except ImportError as missing:
        print(f"{name}: left out, {missing}", file=sys.stderr)
        return None


def offers(robot, envs, arguments):
    """(name, how to make it) of every peer that might take part."""
    device, wanted = arguments.device, arguments.peers
    given = {precision: torch_peers.Given(robot.padded, envs, precision, device) for precision in ("f32", "f64")}
    for precision, tensors in given.items():
        for form in ("matrix", "factor"):
            for solver in SOLVERS:
                yield (f"stiction {form} {solver} {precision}",
                       lambda t=tensors, f=form, s=solver, p=precision: Ours(robot, t, device, f, s, p))
        for method, kind in torch_peers.METHODS.items() if "torch" in wanted else ():
            for graphed in (False, True) if device.startswith("cuda") else (False,):
                name = f"{method}, graph" if graphed else method
                yield f"torch {name} {precision}", lambda n=name, k=kind, t=tensors, g=graphed, p=precision: Theirs(
                    "torch", n, p, lambda: k(t, g), False)
        mjx = optional("mjx_peer") if "mjx" in wanted else None
        for method in mjx.SOLVERS if mjx else ():
            yield f"MJX {method} {precision}", lambda m=method, p=precision: Theirs(
                "MJX", m, p, lambda: mjx.Peer(robot.padded, envs, p, m, device), True, "wall")
    warp = optional("warp_peer") if "warp" in wanted else None
    for method in warp.SOLVERS if warp else ():
        yield f"MuJoCo Warp {method}", lambda m=method: Theirs(
            "MuJoCo Warp", m, "f32", lambda: warp.Peer(robot.padded, envs, m, device), True)


def seconds_of(entrant, device):
    """Seconds of one run, by the clock that the entrant has."""
    if not device.startswith("cuda"):
        begin = time.process_time()
        entrant.run()
        return time.process_time() - begin
    torch.cuda.synchronize()
    if entrant.clock == "wall":
        begin = time.perf_counter()
        entrant.run()
        return time.perf_counter() - begin
    begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
    begin.record()
    entrant.run()
    end.record()
    end.synchronize()
    return 1e-3 * begin.elapsed_time(end)


def qualify(robot, entrant, goal):
    """Sets the largest tolerance that reaches the goal; False if none does."""
    errors = []
    for tolerance in entrant.ladder(goal):
        entrant.tune(tolerance)
        entrant.run()
        entrant.error = robot.error(entrant.reactions())
        if entrant.error <= SLACK * goal:
            return True
        errors.append(entrant.error)
        if len(errors) > 3 and len(set(errors[-4:])) == 1:  # no more can be had in this precision
            return False
    return False


def tuned(robot, arguments):
    """{(name, goal): (tolerance, residual)} of all that reach the goal, with the smallest batch."""
    found = {}
    for name, make in offers(robot, max(min(arguments.envs), len(robot.first)), arguments):
        try:
            entrant = make()
            for goal in arguments.goals:
                if not qualify(robot, entrant, goal):
                    print(f"{robot.name}, {name}: does not reach {goal:g} ({entrant.error:.2g})", file=sys.stderr, flush=True)
                    break
                found[name, goal] = entrant.tolerance, entrant.error
        except Exception as why:  # whatever a package of others raises, the others run
            print(f"{robot.name}, {name}: left out, {type(why).__name__}: {why}", file=sys.stderr, flush=True)
    return found


def turns(entrants, seconds, device):
    """(turns, entrants): mean seconds of each one's two runs of every turn."""
    for entrant in entrants:
        entrant.run()
    table, begin = [], time.monotonic()
    while len(table) < 3 or (len(table) < 25 and time.monotonic() - begin < seconds):
        forth = [seconds_of(entrant, device) for entrant in entrants]
        back = [seconds_of(entrant, device) for entrant in entrants[::-1]][::-1]
        table.append(np.mean([forth, back], axis=0))
    return np.array(table)


def quartiles(values):
    return dict(zip(("ratio_q1", "ratio", "ratio_q3"), np.quantile(values, (0.25, 0.5, 0.75))))


def race(robot, tolerances, envs, arguments):
    """Rows of the table for one batch."""
    made = {}
    for name, make in offers(robot, envs, arguments):
        if any(key[0] == name for key in tolerances):
            try:
                made[name] = make()
                made[name].tune(next(found for key, (found, _) in tolerances.items() if key[0] == name))
                made[name].run()
            except Exception as why:  # no room, above all
                made.pop(name, None)
                print(f"{robot.name}, {envs} environments, {name}: left out, {type(why).__name__}: {why}", file=sys.stderr, flush=True)
    for goal in arguments.goals:
        entrants = [(name, made[name]) for name in made if (name, goal) in tolerances]
        for name, entrant in entrants:
            entrant.tune(tolerances[name, goal][0])
        spent = turns([entrant for _, entrant in entrants], arguments.seconds, arguments.device) * 1e6 / envs
        for i, (our_name, our) in enumerate(entrants):
            for j, (their_name, their) in enumerate(entrants):
                if isinstance(our, Ours) and isinstance(their, Theirs) and (our.form == "matrix") == (their.package == "torch"):
                    yield dict(robot=robot.name, environments=envs, rows=robot.padded.rows, goal=goal, form=our.form, solver=our.name,
                               precision=our.precision, us=np.median(spent[:, i]), residual_p95=tolerances[our_name, goal][1],
                               peer=f"{their.package} {their.name}", peer_precision=their.precision, peer_tolerance=their.tolerance,
                               peer_us=np.median(spent[:, j]), peer_residual_p95=tolerances[their_name, goal][1], clock=their.clock,
                               turns=len(spent), **quartiles(spent[:, j] / spent[:, i]))


def fallback(robot, envs, arguments):
    """The device against the CPU with two threads: rows of the second table."""
    for precision in ("f32", "f64"):
        host, there = (torch_peers.Given(robot.padded, envs, precision, device) for device in ("cpu", arguments.device))
        for solver in ("auto", "npgs"):
            batches = [Ours(robot, given, device, "matrix", solver, precision)
                       for given, device in ((there, arguments.device), (host, "cpu"))]
            machines = [stiction.Solver(device=one.device, solver=solver, tolerance=arguments.goals[0], max_iterations=10000, threads=2)
                        for one in batches]
            table = []
            for turn in range(4):
                spent = []
                for one, machine in zip(batches, machines):
                    begin = time.perf_counter()
                    machine.solve(one.batch, out=one.solution)
                    one.solution.synchronize()
                    spent.append(time.perf_counter() - begin)
                table += [spent] if turn else []
            device, cpu = np.array(table).T * 1e6 / envs
            answers = [one.solution.lambda_.cpu().numpy().tobytes() for one in batches]
            yield dict(robot=robot.name, environments=envs, solver=solver, precision=precision, device_us=np.median(device),
                       cpu_us=np.median(cpu), same_bits=answers[0] == answers[1], **quartiles(cpu / device))


def fastest(rows):
    return min(rows, key=lambda row: (row["us"], row["peer_us"])) if rows else None


def report(rows, alone, device, path):
    lines = ["# stiction and batched peers on one device", "", f"`bench/peers/gpu.py --device {device}`; {measure.machine_name()}; PyTorch "
             f"{torch.__version__}, stiction {stiction.__version__}.", ""]
    if not device.startswith("cuda"):
        lines += ["**A check of the programs on a CPU, not a comparison of devices.**", ""]
    packages = list(dict.fromkeys(row["peer"].rsplit(" ", 1)[0] if "," not in row["peer"] else "torch" for row in rows))
    lines += ["Microseconds of an environment, fastest setting of each side, and the peer's time over stiction's (median, quartiles).", "",
              "| robot (rows) | environments | goal | " + " | ".join(packages) + " |", "|---" * (3 + len(packages)) + "|"]
    for key in dict.fromkeys((row["robot"], row["rows"], row["environments"], row["goal"]) for row in rows):
        cells = []
        for package in packages:
            row = fastest([r for r in rows if (r["robot"], r["rows"], r["environments"], r["goal"]) == key and r["peer"].startswith(package)])
            cells.append("-" if row is None else "{peer} {peer_precision} {peer_us:.3g}, {solver} {precision} {us:.3g}: **{ratio:.2f}** "
                         "({ratio_q1:.2f}-{ratio_q3:.2f})".format(**row))
        lines.append(f"| {key[0]} ({key[1]}) | {key[2]} | {key[3]:g} | " + " | ".join(cells) + " |")
    lines += ["", f"stiction on {device} and on the CPU with two threads, wall clock.", "",
              "| " + " | ".join(FALLBACK_COLUMNS) + " |", "|---" * len(FALLBACK_COLUMNS) + "|"]
    lines += ["| " + " | ".join(f"{row[c]:.3g}" if isinstance(row[c], float) else str(row[c]) for c in FALLBACK_COLUMNS) + " |"
              for row in alone]
    path.write_text("\n".join(lines) + "\n")


def draw(rows, goals, path):
    """Time of an environment against the batch, fastest of each package."""
    try:
        import matplotlib
    except ImportError as missing:
        print(f"no picture: {missing}", file=sys.stderr)
        return

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(row["robot"] for row in rows))
    figure, axes = plt.subplots(1, len(names), figsize=(5 * len(names), 4.5), squeeze=False)
    for axis, name in zip(axes[0], names):
        own = [row for row in rows if row["robot"] == name and row["goal"] == goals[0]]
        curves = {}
        for row in own:
            for label, value in ((f"stiction, {row['form']}", row["us"]), (row["peer"].split(",")[0], row["peer_us"])):
                best = curves.setdefault(label, {})
                best[row["environments"]] = min(best.get(row["environments"], np.inf), value)
        for label, points in curves.items():
            axis.plot(*zip(*sorted(points.items())), marker="o", markersize=3, label=label)
        axis.set(xscale="log", yscale="log", title=f"{name}, to {goals[0]:g}", xlabel="environments")
        axis.grid(alpha=0.3)
    axes[0][0].set_ylabel("microseconds of an environment")
    axes[0][-1].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def write(rows, alone, arguments):
    heads = [f"bench/peers/gpu.py --device {arguments.device}", f"machine: {measure.machine_name()}",
             f"PyTorch {torch.__version__}, stiction {stiction.__version__}"]
    for name, columns, table in (("gpu", COLUMNS, rows), ("gpu_fallback", FALLBACK_COLUMNS, alone)):
        measure.write_table(arguments.results / f"{name}.csv", heads, columns, measure.rounded(table))
    report(rows, alone, arguments.device, arguments.results / "gpu.md")
    draw(rows, arguments.goals, arguments.images / "peers_gpu.png")


def main():
    parser, files_of = measure.race_arguments(__doc__, ROBOTS)
    parser.add_argument("--device", default="cuda")
    parser.add_argument("--envs", type=lambda text: sorted(map(int, text.split(","))), default=[64, 1024, 8192, 32768])
    parser.add_argument("--peers", type=lambda text: text.split(","), default=["torch", "mjx", "warp"])
    parser.add_argument("--seconds", type=float, default=1.0, help="of the turns of one batch and goal")
    arguments = parser.parse_args()
    if arguments.device.startswith("cuda") and not torch.cuda.is_available():
        sys.exit("PyTorch sees no GPU: --device cpu checks the programs without one")
    torch.set_num_threads(1)
    judge = load_judge(arguments.judge)
    files = files_of(arguments)
    rows, alone = [], []
    for path in files:  # tables are written after each
        robot = Robot(path, judge, arguments.device)
        tolerances = tuned(robot, arguments)
        for envs in arguments.envs:
            rows += race(robot, tolerances, envs, arguments)
            print(f"{robot.name}, {envs} environments: done", file=sys.stderr, flush=True)
        alone += fallback(robot, arguments.envs[-1], arguments)
        write(rows, alone, arguments)


if __name__ == "__main__":
    main()
