#!/usr/bin/env python3
"""Where stiction's sweeps stand under one core's roof: operations a second against operations a byte.

    PYTHONPATH=build/python bench/peers/roofline.py [--results DIR] [--images DIR] [--seed 7] [--turns 3] [--quick]

The roof is measured (yardstick.c, compiled here for this machine). It is multiply-adds from registers, and bytes a
second from the first and second cache and from memory. The bytes are the better of a triad (two arrays read, one
written) and of two arrays read. Operations and bytes of a sweep are counted from its formulas, not measured
(counts.py). Time is measured, a call of many sweeps less a call of few, at tolerance 0, processor time of one thread.
So loading, checking and the answer cancel out.

kernels   pgs and npgs on a full A (packs of environments side by side as far as 128 rows). pgs on a factor Y of 22 degrees
          of freedom. Sequential impulses on bodies (packs). f32 and f64
problems  all contacts stick and carry, under matrices whose spectra sweeps take long to go through (matrix, factor), or a
          stack of boxes (bodies). What does not move pushes nothing, and would be counted all the same
batches   `near` takes half of the second cache, `far` four times all of it. A solver takes one environment or pack after
          the other. So a sweep finds its numbers where the pack lies (`level`), not where the batch does

A turn measures the roof, the calls forth and back, and the roof again. share is the median over the turns of what was
reached over min(multiply-adds, intensity times the level's bandwidth). moving: share of contacts whose reactions still
change in the last sixteen sweeps. Writes roofline.csv, roofline.md and peers_roofline.png.
"""

import argparse
import ctypes
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "studies")]

import counts  # noqa: E402
import measure  # noqa: E402
import problems  # noqa: E402
from scaling import DISTINCT, PRECISION, body_batch  # noqa: E402

import stiction  # noqa: E402

CHAINS = 12  # of yardstick.c
SIZES = {"matrix": (8, 22, 64), "factor": (32, 64, 128), "bodies": (8, 22, 64)}  # contacts; few rows have no factor
DOFS = 22
FEW, MANY = 20, {"near": 220, "far": 60}
SOON = 60  # sweeps after which factors and short stacks are still on their way
CONDITION, MU = 1e6, 0.5
LARGEST_PACK = 2**20  # bytes of a pack's matrices (cpu_fallback/pack/work_items.cpp); larger environments come one at a time
COLUMNS = ["kernel", "precision", "contacts", "batch", "environments", "level", "set_kib", "operations", "bytes", "intensity",
           "ns_per_contact_sweep", "gflops", "roof_gflops", "share_q1", "share", "share_q3", "share_of_one_lane", "moving"]
ROOF_COLUMNS = ["what", "f32", "f64"]


def cache_bytes(level, otherwise):
    """Of the data cache that one core has at this level."""
    for index in pathlib.Path("/sys/devices/system/cpu/cpu0/cache").glob("index*"):
        if (index / "level").read_text().strip() == str(level) and (index / "type").read_text().strip() != "Instruction":
            return int((index / "size").read_text().strip().rstrip("K")) * 1024
    print(f"the size of cache {level} is not known: {otherwise // 1024} KiB", file=sys.stderr)
    return otherwise


class Yardstick:
    """What this core can do."""

    def __init__(self, folder):
        library = pathlib.Path(folder, "yardstick.so")
        subprocess.run(["cc", "-O2", "-march=native", "-ffp-contract=fast", "-fno-tree-vectorize", "-fno-tree-slp-vectorize", "-shared",
                        "-fPIC", str(HERE / "yardstick.c"), "-o", str(library)], check=True)
        self.functions = ctypes.CDLL(str(library))
        self.functions.vector_bytes.restype = ctypes.c_size_t
        self.vector = self.functions.vector_bytes()
        first, second = cache_bytes(1, 2**15), cache_bytes(2, 2**20)
        self.levels = {"L1": first, "L2": second, "memory": np.inf}
        self.work = {"L1": first // 2, "L2": second // 2, "memory": 3 * 2**27}
        self.memory = np.ones(self.work["memory"] // 4 + self.vector, np.float32)

    def level(self, bytes_):
        return next(name for name, size in self.levels.items() if bytes_ <= size)

    def _seconds(self, name, *arguments):
        function = getattr(self.functions, name)
        function.restype = ctypes.c_double
        return function(*arguments)

    def operations(self, precision, one=False, rounds=400_000):
        """Operations a second of multiply-adds from registers; `one` lane: without vectors."""
        lanes = 1 if one else self.vector // np.dtype(PRECISION[precision]).itemsize
        name = f"multiply_adds_{'one_' if one else ''}{precision}"
        return 2 * CHAINS * lanes * rounds / self._seconds(name, ctypes.c_long(rounds))

    def bandwidth(self, level, moved=2e8):
        """Bytes a second: (triad, two arrays read)."""
        count = self.work[level] // 3 // self.vector // 8 * 8
        begin = self.memory.ctypes.data + -self.memory.ctypes.data % self.vector
        places = [ctypes.c_void_p(begin + k * count * self.vector) for k in range(3)]
        rounds = max(1, int(moved / (3 * count * self.vector)))
        found = []
        for name, arrays in (("triad", 3), ("read_two", 2)):
            spent = self._seconds(name, *places[:arrays], ctypes.c_size_t(count), ctypes.c_long(rounds))
            found.append(arrays * count * self.vector * rounds / spent)
        return found

    def roof(self, precision, level, intensity):
        return min(self.operations(precision), intensity * max(self.bandwidth(level)))


def stuck(contacts, rng):
    """Reactions inside their cones, and others beside them to start from."""
    normal = rng.uniform(0.5, 1.5, contacts)
    inside = np.stack((normal, *(0.3 * MU * normal * rng.uniform(-1, 1, contacts) for _ in range(2))), axis=1)
    beside = inside * (1 + 0.2 * rng.uniform(-1, 1, inside.shape))
    return inside.ravel(), beside.ravel()


def tiled(pieces, envs, kind):
    return np.tile(np.array(pieces), (-(-envs // len(pieces)),) + (1,) * np.ndim(pieces[0]))[:envs].astype(kind)


def matrix_batch(contacts, envs, precision, seed):
    """(batch, start): full matrices, the first DISTINCT of which differ."""
    few = []
    for index in range(min(DISTINCT, envs)):
        rng = np.random.default_rng([seed, index])
        A, (inside, beside) = problems.with_spectrum(3 * contacts, CONDITION, rng), stuck(contacts, rng)
        few.append((A, -A @ inside, beside))
    A, b, start = (tiled(pieces, envs, PRECISION[precision]) for pieces in zip(*few))
    return stiction.Batch.from_delassus(A, b, mu=MU, law="coulomb"), start


def factor_batch(contacts, envs, precision, seed):
    """(batch, start): directions drawn at random, masses over three decades; A = Y Y'."""
    few, inverse = [], np.logspace(0, -3, DOFS)
    for index in range(min(DISTINCT, envs)):
        rng = np.random.default_rng([seed, index])
        J, (inside, beside) = rng.standard_normal((3 * contacts, DOFS)), stuck(contacts, rng)
        few.append((J, -inverse * (J.T @ inside), beside))
    J, v, start = (tiled(pieces, envs, PRECISION[precision]) for pieces in zip(*few))
    return stiction.Batch.from_jacobian(J, tiled([1 / inverse], envs, PRECISION[precision]), v, mu=MU, law="coulomb"), start


class Case:
    """One kernel on one batch."""

    def __init__(self, form, solver, precision, contacts, where, yardstick, seed):
        self.solver, self.precision, self.contacts, self.where = solver, precision, contacts, where
        self.kernel = {"matrix": solver, "factor": f"{solver}, factor", "bodies": "si, bodies"}[form]
        size, rows, lanes = np.dtype(PRECISION[precision]).itemsize, 3 * contacts, 1
        width = yardstick.vector // size
        if form == "matrix":
            self.sweep, own = counts.of_matrix(contacts, size, solver == "npgs"), size * rows**2
            lanes = width if own * width <= LARGEST_PACK else 1
        elif form == "factor":
            self.sweep, own = counts.of_factor(contacts, DOFS, size), size * rows * DOFS
        else:
            boxes = -(-contacts // 4)
            self.sweep, own, lanes = counts.of_bodies(contacts, boxes, size), size * (22 * contacts + 19 * boxes), width
        self.set, self.one_lane = lanes * self.sweep.bytes, lanes == 1
        self.level = yardstick.level(self.set)
        room = yardstick.levels["L2"] * (0.5 if where == "near" else 4)
        self.environments = max(DISTINCT, int(room / own) // DISTINCT * DISTINCT)
        if form == "bodies":
            self.batch, self.start = body_batch(contacts, self.environments, precision, seed), None
        else:
            make = matrix_batch if form == "matrix" else factor_batch
            self.batch, self.start = make(contacts, self.environments, precision, seed)
        self.many = MANY[where] if form == "matrix" else SOON
        self.solution = stiction.Solution.empty(self.batch)

    def run(self, sweeps):
        """Seconds of a call."""
        solver = stiction.Solver(solver=self.solver, tolerance=0, max_iterations=sweeps, threads=1, stall_window=0)
        begin = time.thread_time()
        solver.solve(self.batch, out=self.solution, warm_start=self.start)
        return time.thread_time() - begin

    def moving(self):
        """Share of contacts whose reactions change in the last sixteen sweeps."""
        found = []
        for sweeps in (self.many - 16, self.many):
            self.run(sweeps)
            found.append(np.reshape(self.solution.lambda_, (-1, 3)).copy())
        return float((found[0] != found[1]).any(axis=1).mean())


def measured(case, yardstick, turns):
    """A row of the table."""
    moving = case.moving()  # also a warm-up
    sweep = case.sweep
    seconds, shares, ones, roofs = [], [], [], []
    for _ in range(turns):
        above = [yardstick.roof(case.precision, case.level, sweep.intensity)]
        forth = [case.run(FEW), case.run(case.many)]
        back = [case.run(case.many), case.run(FEW)]
        runs = np.array([forth, back[::-1]])
        above.append(yardstick.roof(case.precision, case.level, sweep.intensity))
        one = yardstick.operations(case.precision, True, 100_000)
        spent = (runs[:, 1] - runs[:, 0]).mean() / ((case.many - FEW) * case.environments)
        seconds.append(spent)
        roofs.append(np.mean(above))
        shares.append(sweep.operations / spent / np.mean(above))
        ones.append(sweep.operations / spent / one)
    low, middle, high = np.quantile(shares, (0.25, 0.5, 0.75))
    return dict(kernel=case.kernel, precision=case.precision, contacts=case.contacts, batch=case.where, environments=case.environments,
                level=case.level, set_kib=case.set / 1024, operations=sweep.operations, bytes=sweep.bytes, intensity=sweep.intensity,
                ns_per_contact_sweep=1e9 * np.median(seconds) / case.contacts, gflops=sweep.operations / np.median(seconds) / 1e9,
                roof_gflops=np.median(roofs) / 1e9, share_q1=low, share=middle, share_q3=high,
                share_of_one_lane=np.median(ones) if case.one_lane else "", moving=moving)


def cases(yardstick, seed, quick):
    for form, solvers in (("matrix", ("pgs", "npgs")), ("factor", ("pgs",)), ("bodies", ("pgs",))):
        for solver in solvers:
            for precision in ("f32", "f64"):
                for contacts in SIZES[form][:1] if quick else SIZES[form]:
                    yield Case(form, solver, precision, contacts, "near", yardstick, seed)
                    if (solver, precision) == ("pgs", "f32"):
                        yield Case(form, solver, precision, contacts, "far", yardstick, seed)


def roof_rows(yardstick, turns):
    """The machine's own table: the best of all turns."""
    rows = [dict(what="multiply-adds from registers [Gop/s]"), dict(what="the same in one lane [Gop/s]")]
    for row, one in zip(rows, (False, True)):
        row |= {kind: max(yardstick.operations(kind, one) for _ in range(5 * turns)) / 1e9 for kind in PRECISION}
    for level in yardstick.levels:
        found = np.max([yardstick.bandwidth(level) for _ in range(turns)], axis=0) / 1e9
        rows += [dict(what=f"{level}, {name} [GB/s]", f32=value, f64=value) for name, value in zip(("triad", "two arrays read"), found)]
    return rows


def text(value):
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def report(machine, rows, path):
    lines = ["# Sweeps under the roof of one core", "", f"`bench/peers/roofline.py`; {measure.machine_name()}, processor time of one "
             "thread. Operations and bytes are counted (`bench/peers/counts.py`), seconds and the roof measured.", "",
             "| " + " | ".join(ROOF_COLUMNS) + " |", "|---" * len(ROOF_COLUMNS) + "|"]
    lines += ["| " + " | ".join(text(row[column]) for column in ROOF_COLUMNS) + " |" for row in machine]
    lines += ["", "Share: of min(multiply-adds, operations a byte times the bandwidth of the level where the environment or pack lies), "
              "median (quartiles) over turns; one lane: of multiply-adds without vectors, for environments that come one at a time. "
              "moving: share of contacts that change in the last sixteen sweeps.", "",
              "| kernel | contacts | batch: environments | lies in (KiB) | operations, bytes of a sweep | operations a byte | "
              "ns a contact and sweep | Gop/s | roof | share | of one lane | moving |", "|---" * 12 + "|"]
    for row in rows:
        row = {key: text(value) for key, value in row.items()}
        lines.append("| {kernel} {precision} | {contacts} | {batch}: {environments} | {level} ({set_kib}) | {operations}, {bytes} | "
                     "{intensity} | {ns_per_contact_sweep} | {gflops} | {roof_gflops} | {share} ({share_q1}-{share_q3}) | "
                     "{share_of_one_lane} | {moving} |".format(**row))
    path.write_text("\n".join(lines) + "\n")


def draw(machine, rows, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(13, 5), sharey=True)
    intensity = np.geomspace(0.1, 30, 200)
    peak, lane, speeds = machine[0], machine[1], machine[2:]
    for axis, precision in zip(axes, PRECISION):
        for level, style in (("L1", "-"), ("L2", "--"), ("memory", ":")):
            best = max(row[precision] for row in speeds if row["what"].startswith(level))
            axis.plot(intensity, np.minimum(peak[precision], intensity * best), style, color="black", linewidth=1,
                      label=f"{level}, {best:.0f} GB/s")
        axis.axhline(lane[precision], color="grey", linewidth=0.8, label=f"one lane, {lane[precision]:.1f} Gop/s")
        own = [row for row in rows if row["precision"] == precision]
        for colour, kernel in enumerate(dict.fromkeys(row["kernel"] for row in rows)):
            for batch, marker in (("near", "o"), ("far", "x")):
                points = [row for row in own if row["kernel"] == kernel and row["batch"] == batch]
                if points:
                    axis.plot([row["intensity"] for row in points], [row["gflops"] for row in points], marker, color=f"C{colour}",
                              label=f"{kernel}, {batch}")
                for row in points if batch == "near" else []:
                    axis.annotate(row["contacts"], (row["intensity"], row["gflops"]), xytext=(4, 4), textcoords="offset points",
                                  fontsize=7)
        axis.set(xscale="log", yscale="log", title=precision, xlabel="operations a byte (counted); numbers: contacts")
        axis.grid(alpha=0.3)
        axis.legend(fontsize=7)
    axes[0].set_ylabel("10^9 operations a second, one core")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--images", type=pathlib.Path, default=pathlib.Path("."))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one size of each kernel, to see that it runs")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        yardstick = Yardstick(folder)
        rows = []
        for case in cases(yardstick, arguments.seed, arguments.quick):
            rows.append(measured(case, yardstick, arguments.turns))
            print("{kernel} {precision}, {contacts} contacts, {batch}: {ns_per_contact_sweep:.3g} ns, {gflops:.3g} of {roof_gflops:.3g}, "
                  "moving {moving:.2f}".format(**rows[-1]), file=sys.stderr, flush=True)
        machine = roof_rows(yardstick, arguments.turns)
    heads = ["bench/peers/roofline.py", f"machine: {measure.machine_name()}", f"stiction {stiction.__version__}",
             *("{what}: {f32:.4g} f32, {f64:.4g} f64".format(**row) for row in machine)]
    measure.write_table(arguments.results / "roofline.csv", heads, COLUMNS,
                        [{key: f"{value:.4g}" if isinstance(value, float) else value for key, value in row.items()} for row in rows])
    report(machine, rows, arguments.results / "roofline.md")
    draw(machine, rows, arguments.images / "peers_roofline.png")


if __name__ == "__main__":
    main()
