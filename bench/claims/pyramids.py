"""Pyramids against the cone: the area that is lost, the friction that is lost in the worst direction, and what it costs."""

import h5py
import measure
import numpy as np
import problems
from claims.findings import short

SIDES = (4, 8, 16)
PRINTED_AREA = {4: 36.3, 8: 9.0}


def area_lost(sides):
    """Percent of the disk outside the inscribed polygon, from its corners (shoelace)."""
    corners = np.exp(2j * np.pi * np.arange(sides + 1) / sides)
    return 100 * (1 - 0.5 * np.sum(np.imag(np.conj(corners[:-1]) * corners[1:])) / np.pi)


def worst_direction(bench, sides):
    """Largest share of friction that sliding blocks lose, from the solver's own answers, and the largest angle off the motion."""
    path = problems.write(bench.folder / "blocks.h5", "convex", problems.sliding_blocks(720))
    found = bench.solve(path, "ipm", 1e-10, options=["--pyramid", str(sides)] if sides else [], repeats=1)
    normal, first, second = found.lam.reshape(-1, 3).T
    share = np.hypot(first, second) / (0.5 * normal)
    _, along, across = found.w.reshape(-1, 3).T
    cosine = -(first * along + second * across) / (np.hypot(first, second) * np.hypot(along, across))
    return 100 * (1 - share.min()), float(np.degrees(np.arccos(np.clip(cosine.min(), -1, 1))))


def friction_error(path, lam, reference):
    """Of each environment whose friction is at least a hundredth of its normal forces: distance of the friction forces, over the
    length of the reference's. Where hardly anything pulls, a pyramid takes nothing away and the quotient is rounding."""
    errors = []
    normal = np.zeros(len(lam), bool)
    with h5py.File(path) as batch:
        rows, friction = batch["env_row_ptr"][:], np.zeros(len(batch["b"]), bool)
        kind, first = batch["cone_kind"][:], batch["cone_row_ptr"][:]
        for c in np.nonzero(kind == problems.FRICTION)[0]:
            friction[first[c] + 1:first[c + 1]] = True
            normal[first[c]] = True
    for low, high in zip(rows[:-1], rows[1:]):
        own = np.nonzero(friction[low:high])[0] + low
        size = np.linalg.norm(reference[own])
        if size > 0.01 * np.linalg.norm(reference[low:high][normal[low:high]]):
            errors.append(np.linalg.norm(lam[own] - reference[own]) / size)
    return np.array(errors)


def pyramids(bench, findings, arguments, quick):
    loss, off = zip(*(worst_direction(bench, sides) for sides in (0, *SIDES)))
    rows = [("cone", "0", f"{loss[0]:.1e}", f"{off[0]:.1e}")]
    for index, sides in enumerate(SIDES, 1):
        rows.append((sides, f"{area_lost(sides):.2f}", f"{loss[index]:.2f}", f"{off[index]:.1f}"))
        findings.add("pyramids", "720 sliding blocks", f"{sides} sides", area_lost_percent=area_lost(sides),
                     worst_friction_lost_percent=loss[index], worst_angle_degrees=off[index])
    findings.table("Blocks sliding in 720 directions: what a pyramid takes away", ("sides", "area lost [%]", "friction lost, worst direction [%]",
                                                                                  "friction off the motion, worst [degrees]"), rows)
    for sides, printed in PRINTED_AREA.items():
        own = area_lost(sides)
        findings.conclude(f"pyramid of {sides}", "10.5", f"{sides} sides lose {printed} % of the area",
                          f"{own:.2f} % of the area; {loss[1 + SIDES.index(sides)]:.1f} % of the friction in the worst direction",
                          "holds" if abs(own - printed) < 0.1 else "does not hold")
    scenes(bench, findings, arguments, quick)


def scenes(bench, findings, arguments, quick):
    rows, slower, errors = [], [], {sides: [] for sides in SIDES}
    for name in ("humanoid",) if quick else ("humanoid", "go1", "g1", "leap_hand", "franka_cube"):
        path = measure.recorded(arguments, f"mujoco/{name}.h5", f"{name}.h5")
        if not path:
            continue
        exact = bench.solve(path, "newton", 1e-10, repeats=1)
        copies = 2 if quick else 8
        cone = bench.solve(path, "npgs", 1e-6, 20000, copies=copies)
        cells = [short(cone.microseconds, 3)]
        for sides in SIDES:
            option = ["--pyramid", str(sides)]
            tight = bench.solve(path, "ipm", 1e-10, repeats=1, options=option)
            error = friction_error(path, tight.lam, exact.lam)
            if len(error):
                errors[sides].append(np.median(error))
            timed = {solver: bench.solve(path, solver, 1e-6, 20000, copies=copies, options=option) for solver in ("npgs", "lemke")}
            slower.append(timed["npgs"].microseconds / cone.microseconds)
            lost = (f"{np.median(error):.1%}", f"{error.max():.0%}") if len(error) else ("-", "-")
            cells.append(f"{', '.join(lost)}; " + " / ".join(
                short(own.microseconds, 3) + (f" ({own.unsolved} not)" if own.unsolved else "") for own in timed.values()))
            findings.add("pyramids", name, f"{sides} sides", friction_error_median=np.median(error) if len(error) else np.nan,
                         friction_error_worst=error.max(initial=np.nan if not len(error) else 0),
                         npgs_us=timed["npgs"].microseconds, lemke_us=timed["lemke"].microseconds, cone_npgs_us=cone.microseconds,
                         npgs_unsolved=timed["npgs"].unsolved, lemke_unsolved=timed["lemke"].unsolved)
        rows.append((name, *cells))
    findings.table("Recorded robots, residual 1e-6. Cone: us of `npgs`. Pyramids: error of the friction forces (median, worst environment); us of "
                   "`npgs` / `lemke`; (n not): n environments did not get there",
                   ("file", "cone", *(f"{sides} sides" for sides in SIDES)), rows)
    middle = [float(np.median(errors[sides])) for sides in SIDES]
    findings.conclude("cone instead of pyramids", "8.3", "cones avoid the pyramids' error and converge better",
                      f"median error of friction with 4, 8, 16 sides: {', '.join(f'{m:.1%}' for m in middle)}; `npgs` takes {min(slower):.1f} to "
                      f"{max(slower):.1f} times as long on pyramids as on the cone", "holds" if min(slower) > 1 else "partly")
