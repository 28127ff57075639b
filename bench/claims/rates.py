"""The claim that Gauss-Seidel contracts by 1 - 2/(kappa + 1) a sweep, over families of problems, with its picture."""

import h5py
import measure
import numpy as np
import problems
from claims.findings import short

LIMIT = 2000000


def conditions(A):
    """(kappa of A, kappa of A scaled to a unit diagonal), over eigenvalues above rounding."""
    scale = 1 / np.sqrt(np.diag(A))
    found = []
    for matrix in (A, scale[:, None] * A * scale):
        values = np.linalg.eigvalsh(0.5 * (matrix + matrix.T))
        values = values[values > 1e-12 * values[-1]]
        found.append(float(values[-1] / values[0]))
    return found


def contraction(bench, path, tight=1e-9):
    """Residual's factor a sweep between 1e-4 and `tight`, for each environment; 0 where the first look found it solved."""
    loose, late = (bench.solve(path, "pgs", tolerance, LIMIT, repeats=1) for tolerance in (1e-4, tight))
    if not (loose.answered and late.answered):
        return np.array([])
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = (late.residual / loose.residual) ** (1 / (late.iterations - loose.iterations))
    rate[(late.iterations == loose.iterations) & (late.residual <= tight)] = 0.0
    rate[late.residual > 1.02 * tight] = np.nan
    return rate


def families(quick):
    """name -> list of (problem, exact contraction or None)."""
    rng = np.random.default_rng(5)
    masses = [1.0, 10.0, 100.0] if quick else [1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e4]
    sizes = [3, 5, 10] if quick else [3, 5, 10, 20, 40, 80, 160]
    spread = [10.0, 100.0] if quick else np.logspace(0.5, 4, 15)

    def bottom_up(*column):
        A = problems.column(column)[0]
        return problems.normals_only(A, -A @ problems.carried(column))

    return {
        "columns of 3 to 160": [(bottom_up(*np.ones(n)), np.cos(np.pi / (2 * n)) ** 2) for n in sizes],
        "heavy body on a light one": [(bottom_up(1, q), q / (1 + q)) for q in masses],
        "light body on a heavy one": [(bottom_up(q, 1), 1 / (1 + q)) for q in masses],
        "bodies that do not touch": [(problems.closed(np.diag(np.logspace(0, -np.log10(q), 10)), rng), 0.0) for q in masses[1:]],
        "random directions, 20 rows": [(problems.closed(problems.with_spectrum(20, k, rng), rng), None) for k in spread],
    }


def measured(bench, arguments, quick):
    """name -> rows (kappa, kappa scaled, contraction, exact or nan)."""
    points = {}
    for name, members in families(quick).items():
        path = problems.write(bench.folder / "family.h5", "coulomb", [problem for problem, _ in members])
        rates = contraction(bench, path)
        points[name] = [(*conditions(problem[0]), rate, np.nan if exact is None else exact)
                        for (problem, exact), rate in zip(members, rates)]
    scenes = [("stacks of 1 to 10, friction", [bench.generate("stack", n, 4) for n in (1, 2, 5, 10)]),
              ("humanoid", [measure.recorded(arguments, "mujoco/humanoid.h5", "humanoid.h5")]),
              ("Go1, G1, hand, Panda", [measure.recorded(arguments, f"mujoco/{name}.h5")
                                        for name in ("go1", "g1", "leap_hand", "franka_cube")])]
    for name, paths in scenes[:1] if quick else scenes:
        points[name] = []
        for path in filter(None, paths):
            rates = contraction(bench, path)
            points[name] += [(*conditions(problems.dense(path, e)[0]), rate, np.nan) for e, rate in enumerate(rates)
                             if np.isfinite(rate)]
    return points


def rates(bench, findings, arguments, image, quick):
    points = measured(bench, arguments, quick)
    rows, faster, slower, total = [], 0, 0, 0
    for name, own in points.items():
        table = np.array(own).reshape(-1, 4)
        table = table[np.isfinite(table[:, 2])]
        gap, promised = 1 - table[:, 2], 2 / (table[:, 0] + 1)
        ratio = gap / promised
        faster, slower, total = faster + (ratio > 2).sum(), slower + (ratio < 0.5).sum(), total + len(ratio)
        exact = np.abs(table[:, 2] - table[:, 3])[np.isfinite(table[:, 3])]
        rows.append((name, len(table), f"{short(table[:, 0].min())} to {short(table[:, 0].max())}",
                     f"{short(gap.min())} to {short(gap.max())}", f"{short(ratio.min())} to {short(ratio.max())}",
                     short(exact.max()) if len(exact) else "-"))
        for kappa, scaled, rate, known in table:
            findings.add("rate", name, f"kappa {kappa:.6g}", kappa_scaled=scaled, contraction=rate, exact=known)
    findings.table("Contraction of `pgs` a sweep, measured between residuals 1e-4 and 1e-9",
                   ("family", "problems", "kappa(A)", "1 - contraction", "(1 - contraction) / (2 / (kappa + 1))", "largest error of the exact rate"),
                   rows)
    findings.conclude("rate", "3.1", "PGS contracts by 1 - 2/(kappa(A) + 1) a sweep",
                      f"of {total} problems {faster} contract at more than twice that speed, {slower} at less than half; times that speed: "
                      + ", ".join(f"{name} {ratios}" for name, _, _, _, ratios, _ in rows),
                      "does not hold" if faster + slower > 0.2 * total else "partly")
    draw(points, image)


def draw(points, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(13, 5.6), sharey=True)
    colours = plt.get_cmap("tab10").colors
    for column, (axis, label) in enumerate(zip(axes, ("kappa(A)", "kappa of A scaled to a unit diagonal"))):
        for index, (name, own) in enumerate(points.items()):
            table = np.array(own).reshape(-1, 4)
            large = len(table) < 20
            axis.plot(table[:, column], 1 - table[:, 2], "os^vDPX*"[index % 8], color=colours[index], label=name,
                      markersize=6 if large else 4, alpha=0.9 if large else 0.5, linestyle="")
        kappa = np.logspace(0, max(np.log10(axis.get_xlim()[1]), 1), 100)
        axis.plot(kappa, np.minimum(1, 2 / (kappa + 1)), "k--", linewidth=1.2, label="the chapter: 2 / (kappa + 1)")
        axis.plot(kappa, 4 * kappa / (kappa + 1) ** 2, "k:", linewidth=1.2,
                  label="consistently ordered, unit diagonal: $1 - ((\\kappa-1)/(\\kappa+1))^2$")
        axis.set(xscale="log", yscale="log", xlabel=label)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("1 - contraction of the residual per sweep of pgs")
    axes[1].legend(fontsize=8, loc="lower left")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def scaling(bench, findings, arguments):
    """Diagonal scaling: what it does to kappa, and that sweeps do not notice."""
    rng = np.random.default_rng(5)
    rows, gains = [], []
    problem = problems.cubes([1, 1000], rng)
    heavy = problems.write(bench.folder / "heavy.h5", "coulomb", [problem])
    files = [("heavy cube on a light one", heavy)] + [(name, measure.recorded(arguments, f"mujoco/{name}.h5", f"{name}.h5"))
                                                       for name in ("humanoid", "g1", "leap_hand")]
    for name, path in files:
        if not path:
            continue
        with h5py.File(path) as batch:
            count = len(batch["env_row_ptr"]) - 1
        both = np.array([conditions(problems.dense(path, e)[0]) for e in range(count)])
        before, after = np.median(both, axis=0)
        gains.append(before / after)
        rows.append((name, short(before), short(after)))
        findings.add("diagonal scaling", name, "median", kappa=before, kappa_scaled=after)
    findings.table("Condition number, median over environments", ("problem", "A + diag R", "scaled to a unit diagonal"), rows)
    findings.conclude("diagonal scaling", "4.3", "scaling to a unit diagonal improves conditioning markedly",
                      "; ".join(f"{name}: {before} to {after}" for name, before, after in rows) + ". Sweeps do not notice: a visit of one row "
                      "is the same step in any scaling (the picture's families with the same contraction at every kappa)",
                      "holds" if min(gains) > 2 else "partly" if max(gains) > 2 else "does not hold")
