"""Claims about methods that factorise: pivots of Lemke's method, iterations of interior points, islands."""

import measure
import numpy as np
import problems
from claims.findings import short
from claims.sweeps import exponent


def lemke(bench, findings, quick):
    rng = np.random.default_rng(11)
    sizes = [8, 16, 32] if quick else [8, 16, 32, 64, 128, 256]
    rows, counts = [], {"column": [], "random": []}
    times = {"column": [], "random": []}
    for size in sizes:
        makers = {"column": lambda: problems.column(np.ones(size), rng), "random": lambda: problems.random_complementarity(size, rng)}
        cells = []
        for name, make in makers.items():
            path = problems.write(bench.folder / "pivots.h5", "coulomb", [make() for _ in range(16 if size <= 64 else 4)])
            found = bench.solve(path, "lemke", 1e-10, repeats=3)
            counts[name].append(float(found.iterations.mean()))
            times[name].append(found.microseconds)
            cells.append(f"{found.iterations.mean():.0f}, {short(found.microseconds, 3)}, {found.worst:.0e}")
            findings.add("lemke", f"{name} of {size}", "1e-10", pivots=found.iterations.mean(), us_per_env=found.microseconds,
                         residual_worst=found.worst, unsolved=found.unsolved)
        rows.append((size, *cells))
    findings.table("`lemke`: pivots (mean; looked at every eighth), us per environment, worst residual",
                   ("rows", "column, all closed", "random, half closed"), rows)
    growth = {name: exponent(sizes[1:], own[1:]) for name, own in counts.items()}
    cost = {name: exponent(sizes[2:], own[2:]) if len(sizes) > 3 else np.nan for name, own in times.items()}
    findings.conclude("Lemke: pivots", "4.1", "in practice O(n) to O(n^2) pivots of O(n^2) each",
                      f"pivots grow as n^{growth['column']:.2f} (columns) and n^{growth['random']:.2f} (random); the time as "
                      f"n^{short(cost['column'])} and n^{short(cost['random'])}", "holds" if max(growth.values()) <= 2.1 else "does not hold")


def interior_point(bench, findings, arguments, quick):
    chosen = [("column of 100", bench.generate("column", 100, 8), None), ("stack of 10", bench.generate("stack", 10, 8), "convex"),
              ("wall 5 x 5", bench.generate("wall", 5, 2), "convex"), ("stack of 10", bench.generate("stack", 10, 8), "coulomb")]
    chosen += [(name, measure.recorded(arguments, f"mujoco/{name}.h5", f"{name}.h5"), None)
               for name in ("humanoid", "g1", "leap_hand", "aloha_peg", "cube_3x3x3")]
    rows, convex = [], []
    for name, path, law in chosen[::4] if quick else chosen:
        if not path:
            continue
        found = bench.solve(path, "ipm", 1e-8, 2000, law=law or "file", repeats=1)
        if not found.answered:
            rows.append((name, law or "as in the file", found.note, "", ""))
            continue
        low, high = int(np.median(found.iterations)), int(found.iterations.max())
        rows.append((name, law or "as in the file", low, high, found.unsolved))
        findings.add("ipm", name, law or "file", iterations_median=low, iterations_max=high, unsolved=found.unsolved)
        if law != "coulomb":
            convex.append((low, high))
    findings.table("`ipm` to 1e-8: iterations", ("problem", "law", "median", "most", "unsolved"), rows)
    lows, highs = zip(*convex)
    findings.conclude("interior points", "4.2", "predictor-corrector: typically 10 to 30 iterations",
                      f"medians {min(lows)} to {max(lows)} to 1e-8 under the convex law and without friction, at most {max(highs)}",
                      "holds" if max(lows) <= 30 else "partly")


def islands(bench, findings, quick):
    rng = np.random.default_rng(13)
    pieces, rows, gains = 4 if quick else 8, [], {}
    path = problems.write(bench.folder / "islands.h5", "coulomb",
                          [problems.side_by_side([problems.cubes([1, 1, 1], rng) for _ in range(pieces)]) for _ in range(4)])
    for solver in ("ipm", "admm", "npgs"):
        together, apart = (bench.solve(path, solver, 1e-4, 20000, law="convex", options=["--islands", how])
                           for how in ("together", "apart"))
        if not (together.answered and apart.answered):
            rows.append((f"`{solver}`", together.note or apart.note, "", ""))
            continue
        gains[solver] = together.microseconds / apart.microseconds
        rows.append((f"`{solver}`", short(together.microseconds, 3), short(apart.microseconds, 3), f"{gains[solver]:.1f}"))
        findings.add("islands", f"{pieces} stacks of 3", solver, together_us=together.microseconds, apart_us=apart.microseconds,
                     unsolved_together=together.unsolved, unsolved_apart=apart.unsolved)
    findings.table(f"{pieces} stacks of 3 boxes in one environment ({36 * pieces} rows), convex law, to 1e-4: us per environment",
                   ("solver", "together", "apart", "gain"), rows)
    findings.conclude("islands", "5.2", "solving components apart gains n^3 / sum n_i^3",
                      f"{pieces} equal components promise {pieces**2}: " + ", ".join(f"`{solver}` {gain:.1f}" for solver, gain in gains.items()),
                      "holds" if gains and min(gains.values()) > pieces**2 / 2 else
                      "partly" if gains and max(gains.values()) > pieces**2 / 2 else "does not hold")


def printed_step(findings):
    """The step of the listing in 3.1: the sum without the diagonal, and still a start at lambda."""
    rng = np.random.default_rng(17)
    right = {"printed": 0, "corrected": 0}
    count = 200
    for _ in range(count):
        A, b, _, _ = problems.random_complementarity(10, rng)
        for name in right:
            x, settled = np.zeros(len(b)), 0
            for _ in range(2000):
                for i in range(len(b)):
                    whole = A[i] @ x + b[i]
                    x[i] = max(0.0, x[i] - (whole - (A[i, i] * x[i] if name == "printed" else 0)) / A[i, i])
                # A sweep may pass through the solution and walk on: it has to stay there.
                settled = settled + 1 if np.abs(np.minimum(x, A @ x + b)).max() < 1e-8 else 0
                if settled == 3 or np.abs(x).max() > 1e9:
                    break
            right[name] += settled > 0
    findings.add("printed step", f"{count} random problems of 10 rows", "at most 2000 sweeps", printed=right["printed"], corrected=right["corrected"])
    findings.conclude("the step of PGS", "3.1", "r = (b_i + sum over j != i of A_ij lambda_j)/A_ii, lambda_i = max(0, lambda_i - r)",
                      f"as printed it solves {right['printed']} of {count} random problems; with the whole sum {right['corrected']}",
                      "holds" if right["printed"] == count else "does not hold")
