"""One page on the tables that run.py's parts have written: what was asked for, and what came out."""

import pathlib

import measure
import numpy as np
import slopes
from table import read


def rows_of(path):
    """A table's rows, none where there is no table; with or without comment lines above."""
    return read(path)[1] if pathlib.Path(path).is_file() else []


def spread(values, form=".2f"):
    """Median, and least to most."""
    values = [value for value in values if np.isfinite(value)]
    if not values:
        return "nothing to compare"
    return f"{np.median(values):{form}} ({min(values):{form}} to {max(values):{form}}; {len(values)})"


def ratio_lines(folder):
    found = {}
    for row in rows_of(folder / "ratio.csv"):
        kind = row["implementation"].split()[0]
        if kind in ("stiction", "eigen"):
            key = row["family"], int(row["contacts"])
            for part in ("sweeps", "whole"):
                best = found.setdefault(key, {}).setdefault(part, {})
                best[kind] = max(best.get(kind, 0), float(row[f"{part}_median"]))
    for part, title in (("sweeps", "sweeps alone"), ("whole", "whole call of 20 sweeps")):
        if found:
            yield "C1", f"naive loop's time over stiction's, {title}", "10; 20", spread(best[part]["stiction"] for best in found.values())
            for most, least, asked in ((8, 0, "6; 12"), (22, 9, "3; 5")):
                own = [best[part] for (_, contacts), best in found.items() if least < contacts <= most and "eigen" in best[part]]
                if own:
                    yield ("C2", f"Eigen's time over stiction's, {title}, {'up to 8' if most == 8 else '9 to 22'} contacts", asked,
                           spread(best["stiction"] / best["eigen"] for best in own))


ASKED_OF_ROBOTS = {("matrix", 1e-4): "7; 20", ("matrix", 1e-6): "3; 10"}


def fastest(rows):
    """MuJoCo's time over stiction's, the fastest setting of each, robot by robot."""
    for robot in dict.fromkeys(row["robot"] for row in rows):
        own = [row for row in rows if row["robot"] == robot]
        yield float(min(own, key=lambda row: (float(row["us"]), float(row["peer_us"])))["ratio"])


def robot_lines(folder):
    for path in sorted(folder.glob("robots*.csv")):
        rows = rows_of(path)
        envs = max((int(row["environments"]) for row in rows), default=0)
        for form, start, goal in dict.fromkeys((row["form"], row["start"], row["goal"]) for row in rows):
            own = [row for row in rows if (row["form"], row["start"], row["goal"]) == (form, start, goal)]
            where = f"{form} form, {start} start, {float(goal):g}; robots, {envs} environments"
            asked = ASKED_OF_ROBOTS.get((form, float(goal)), "2; 6") if start == "cold" else "2; 6"
            yield "C3", f"MuJoCo's time over stiction's, fastest of each, {where}", asked, spread(fastest(own))
            for peer in ("Newton", "PGS") if (form, start) == ("matrix", "cold") else ():
                of_peer = [row for row in own if row["peer"] == peer]
                if of_peer:
                    yield ("C3", f"MuJoCo's {peer} over stiction's fastest, {where}", "20" if peer == "PGS" else asked,
                           spread(fastest(of_peer)))


def sweep_lines(folder):
    own = [row for row in rows_of(folder / "engines_sweeps.csv") if row["scene"] and row["precision"] == "f32"]
    bullet = {row["scene"]: row for row in own if row["solver"] == "Bullet si"}
    for solver in ("stiction si", "stiction si, momentum"):
        ours = [row for row in own if row["solver"] == solver and row["scene"] in bullet]
        if ours:
            yield "C4", f"Bullet's time over that of {solver} on bodies, a contact and sweep, f32", "8; 30", spread(
                float(row["ratio"]) for row in ours)
            yield "C4", f"the same, whole calls of 20 sweeps, {solver}", "8; 30", spread(
                float(bullet[row["scene"]]["ns_call"]) / float(row["ns_call"]) for row in ours)


def against_lines(folder):
    rows = rows_of(folder / "against.csv")
    for goal in dict.fromkeys(row["goal"] for row in rows):
        ratios, more, files = [], [0, 0], dict.fromkeys((row["file"], row["law"]) for row in rows)
        for file, law in files:
            own = [row for row in rows if (row["file"], row["law"], row["goal"]) == (file, law, goal)]
            best = [min((row for row in own if row["solver"].startswith("stiction") is ours), default=None,
                        key=lambda row: (-int(row["solved"]), float(row["ms_total"]))) for ours in (True, False)]
            if None in best:
                continue
            solved = [int(row["solved"]) for row in best]
            if solved[0] == solved[1] > 0:
                ratios.append(float(best[1]["ms_total"]) / float(best[0]["ms_total"]))
            more = [more[0] + (solved[0] > solved[1]), more[1] + (solved[0] < solved[1])]
        yield ("C5", f"others' time over stiction's to {float(goal):g}, files of which both solve as many; stiction solves more in "
               f"{more[0]}, others in {more[1]}", "5; 20" if float(goal) >= 1e-4 else "2; 5", spread(ratios))


def scaling_lines(folder):
    rows = rows_of(folder / "scaling.csv")
    if not rows:
        return
    for form, precision, envs, ratio in slopes.second_thread(rows):
        yield "C6", f"two threads over one, {form} {precision}, {envs} environments", "1.85; 1.95", ratio
    asked = {"bodies": "1.08; 1.03", "face": "2.1; 2.0"}
    for series, form, precision, threads, slope, error in slopes.exponents(rows):
        if series == "environments":
            yield "S4", f"exponent over environments, {form} {precision}, threads {threads}", "1 +- 0.05; 0.02", f"{slope:.3f} +- {error:.3f}"
        elif form in asked:
            yield "S5", f"exponent over contacts, {form}", asked[form], f"{slope:.3f} +- {error:.3f}"
    for row in rows_of(folder / "warm.csv"):
        yield ("A3", f"iterations from zero over warm, {row['sequence']}, {row['solver']}, {float(row['goal']):g}",
               "3; 8" if float(row["goal"]) >= 5e-3 else "1.7; 3", f"{row['gain_iterations']} ({row['gain_q1']} to {row['gain_q3']})")


def roofline_lines(folder):
    rows = rows_of(folder / "roofline.csv")
    for kernel, precision in dict.fromkeys((row["kernel"], row["precision"]) for row in rows):
        own = [row for row in rows if (row["kernel"], row["precision"], row["batch"]) == (kernel, precision, "near")]
        lanes = [float(row["share_of_one_lane"]) for row in own if row["share_of_one_lane"]]
        said = f"; of one lane's multiply-adds {spread(lanes)}" if lanes else ""
        yield "G10", f"share of one core's roof, {kernel} {precision}", "0.5; 0.7", spread(float(row["share"]) for row in own) + said


GPU_ASKED = {"MuJoCo Warp": ("G1", "4; 10"), "MJX": ("G4", "20; 60"), "torch PGS": ("G5", "50; 200"), "torch APGD": ("G5", "8; 20"),
             "torch ADMM": ("G5", "-")}


def gpu_lines(folder):
    rows = rows_of(folder / "gpu.csv")
    for peer, (what, asked) in GPU_ASKED.items():
        best = {}
        for row in rows:
            if row["peer"].startswith(peer):
                best.setdefault((row["robot"], row["environments"], row["goal"]), []).append(row)
        if best:
            yield (what, f"{peer}'s time over stiction's on one device, fastest of each; robots, batches and goals", asked,
                   spread(float(min(own, key=lambda row: (float(row["us"]), float(row["peer_us"])))["ratio"]) for own in best.values()))
    alone = rows_of(folder / "gpu_fallback.csv")
    if alone:
        same = sum(row["same_bits"] == "True" for row in alone)
        yield ("X1", f"two threads' time over the device's, the same bits in {same} of {len(alone)}", "60; 150",
               spread(float(row["ratio"]) for row in alone))


def text(folder, ended):
    """The page. ended: (part, question, how it ended, seconds)."""
    lines = ["# Comparisons", "", f"`bench/peers/run.py`; {measure.machine_name()}; {sum(one[3] for one in ended):.0f} s.", "",
             "| part | what | how it ended | s |", "|---|---|---|---|"]
    lines += [f"| {name} | {question} | {said} | {spent:.0f} |" for name, question, said, spent in ended]
    lines += ["", "Median over the cases (least to most; how many), each the fastest setting of either side. Of ratios of times above 1, "
              "stiction is the faster; asked: what had to be reached, and what was hoped for.", "", "| | what | asked | found |", "|---|---|---|---|"]
    for part in (ratio_lines, robot_lines, sweep_lines, against_lines, scaling_lines, roofline_lines, gpu_lines):
        lines += [f"| {' | '.join(row)} |" for row in part(folder)]
    return "\n".join(lines) + "\n"
