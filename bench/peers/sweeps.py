"""Time for a contact and a sweep, and the residual after 20 and 60 sweeps: sequential impulses of engines and of stiction."""

import json
import os
import pathlib
import subprocess

import boxed
import engine_programs as programs
import h5py
import measure
import numpy as np
import rigid
from environments import write_batch
from table import read

SHORT, LONG = 20, 60
SECONDS = 0.001  # of calls of one environment in one pass
SCENES = [("stack", 2, 64), ("stack", 10, 64), ("pile", 20, 64), ("wall", 4, 64)]
COLUMNS = ["scene", "contacts", "environments", "solver", "precision", "form", "law", "ns_sweep", "ns_call", "residual_20",
           "residual_60", "ratio_q1", "ratio", "ratio_q3"]
FIRST = "Bullet si", "f32"  # the 1 of every ratio
BOXED, CONES = "boxed", "coulomb"


class Engine:
    def __init__(self, name, precision, program, solver, form, law):
        self.name, self.precision, self.program, self.solver, self.form, self.law = name, precision, program, solver, form, law

    def solve(self, field, iterations):
        """(seconds of sweeping, seconds of all, reactions), all environments."""
        rows = [len(given.b) for given in field.given]
        path = field.scenes_file if self.form == "bodies" else field.matrices_file
        answers = programs.solve(self.program, self.solver, iterations, SECONDS, path, rows, field.folder)
        solving, forming = sum(answer[1] for answer in answers), sum(answer[2] for answer in answers)
        return solving, solving + forming, [answer[0] for answer in answers]


class Stiction:
    form, law = "A", CONES

    def __init__(self, program, solver, precision, clock):
        self.name, self.program, self.solver, self.precision, self.clock = f"stiction {solver}", program, solver, precision, clock

    def solve(self, field, iterations):
        report, answer = pathlib.Path(field.folder, "report.json"), pathlib.Path(field.folder, "answer.h5")
        subprocess.run([self.program, "solve", str(field.batch_file), "--solver", self.solver, "--precision", self.precision,
                        "--tolerance", "0", "--max-iterations", str(iterations), "--threads", "1", "--quiet", "--json",
                        str(report), "-o", str(answer)], env={**os.environ, **self.clock}, capture_output=True)
        seconds = json.loads(report.read_text())["seconds"]["solve"] / field.copies
        with h5py.File(answer) as solution:
            reaction = solution["lambda"][:sum(len(given.b) for given in field.given)].astype("f8")
        return seconds, seconds, np.split(reaction, np.cumsum([len(given.b) for given in field.given])[:-1])


class Field:
    """The environments of one scene, in every form."""

    copies = 2  # of the batch, so that a call of stiction's takes milliseconds

    def __init__(self, bench, kind, size, count):
        self.name, self.folder = f"{kind} {size}", bench.folder
        found = rigid.read_scenes(bench.generate(kind, size, count))
        self.environments = [scene.environment() for scene in found]
        self.given = [boxed.of_environment(e) for e in self.environments]
        self.contacts = sum(len(scene.pairs) for scene in found)
        self.scenes_file = programs.write(bench.folder / "sweeps_scenes.bin", [scene.records() for scene in found])
        self.matrices_file = programs.write(bench.folder / "sweeps_matrices.bin", [programs.boxed_records(g) for g in self.given])
        self.batch_file, self.one_file = bench.folder / "sweeps.h5", bench.folder / "sweeps_one.h5"
        write_batch(self.one_file, self.environments, CONES, "sweeps.py")
        write_batch(self.batch_file, self.environments * self.copies, CONES, "sweeps.py")

    def residual(self, law, reactions, judge):
        """Of the worst environment, in the solver's own law."""
        if law == BOXED:
            return max(map(boxed.residual, self.given, reactions))
        with h5py.File(self.one_file) as batch:
            return float(judge(batch, np.concatenate(reactions), law).max())


def entrants(bench, built, stiction):
    clock = measure.processor_clock(bench.folder)
    bodies = pathlib.Path(stiction).resolve().parents[1] / "bench" / "bench_body_file"
    for name, precision, program, solver, form in (("Bullet si", "f32", "Bullet f32", "si", "bodies"),
                                                   ("Bullet si", "f64", "Bullet f64", "si", "bodies"),
                                                   ("ODE quick", "f64", "ODE", "quick", "bodies"),
                                                   ("Bullet pgs", "f64", "Bullet f64", "pgs", "A")):
        if program in built:
            yield Engine(name, precision, built[program], solver, form, BOXED)
    for precision in ("f32", "f64"):
        if bodies.exists():
            yield Engine("stiction si", precision, bodies, f"si_{precision}", "bodies", CONES)
            yield Engine("stiction si, momentum", precision, bodies, f"momentum_{precision}", "bodies", CONES)
        for solver in ("pgs", "npgs"):
            yield Stiction(stiction, solver, precision, clock)


def compare(bench, built, stiction, scene, passes, judge):
    """Rows of the table for one scene."""
    everyone, field = list(entrants(bench, built, stiction)), Field(bench, *scene)
    measured = {entrant: [] for entrant in everyone}
    for one in range(passes + 1):  # the first is a warm-up
        for entrant in everyone[::-1] if one % 2 else everyone:
            measured[entrant].append([entrant.solve(field, sweeps) for sweeps in (SHORT, LONG)])
    slopes = {entrant: np.array([(far[0] - near[0]) / (LONG - SHORT) for near, far in own[1:]])
              for entrant, own in measured.items()}
    first = next((entrant for entrant in everyone if (entrant.name, entrant.precision) == FIRST), None)
    rows = []
    for entrant, own in measured.items():
        residual = [field.residual(entrant.law, reactions, judge) for _, _, reactions in own[0]]
        call = np.median([near[1] for near, _ in own[1:]]) / SHORT
        sweep = np.median(slopes[entrant])
        row = dict(scene=field.name, contacts=field.contacts // len(field.given), environments=len(field.given),
                   solver=entrant.name, precision=entrant.precision, form=entrant.form, law=entrant.law,
                   ns_sweep=f"{1e9 * sweep / field.contacts:.3g}", ns_call=f"{1e9 * call / field.contacts:.3g}",
                   residual_20=f"{residual[0]:.2g}", residual_60=f"{residual[1]:.2g}")
        if first:
            row.update(zip(("ratio_q1", "ratio", "ratio_q3"),
                           (f"{value:.3g}" for value in np.quantile(slopes[first] / slopes[entrant], (0.25, 0.5, 0.75)))))
        rows.append(row)
    return rows


def baselines(bench, stiction):
    """The loop and Eigen's, by bench_ratio, where it is built beside the command line."""
    program, table = pathlib.Path(stiction).resolve().parents[1] / "bench" / "bench_ratio", bench.folder / "ratio.csv"
    if not program.exists():
        return []
    subprocess.run([program, "--contacts", "8", "--envs", "512", "--family", "stack", "--precision", "f32,f64", "--repeats", "3",
                    "--csv", table], check=True, capture_output=True)
    return [dict(scene="stack 2, by bench_ratio", contacts=8, environments=512, solver=row["implementation"],
                 precision=row["precision"], form="A", law=CONES, ns_sweep=row["ns_sweeps"], ns_call=row["ns_whole"],
                 residual_20=row["residual_20"], residual_60=row["residual_60"])
            for row in read(table)[1] if row["flags"] == "-O3" or row["implementation"].startswith("stiction")]


def table(rows):
    lines = ["| scene, contacts, environments | solver | precision | works on | law | ns a contact and sweep | "
             "the same, whole call of 20 | residual after 20, 60 | times Bullet's si in f32: median (quartiles) |",
             "|---|---|---|---|---|---|---|---|---|"]
    for row in rows:
        ratio = "{ratio} ({ratio_q1}-{ratio_q3})".format(**row) if "ratio" in row else ""
        lines.append("| {scene}, {contacts}, {environments} | {solver} | {precision} | {form} | {law} | {ns_sweep} | {ns_call} | "
                     "{residual_20}, {residual_60} | ".format(**row) + ratio + " |")
    return lines
