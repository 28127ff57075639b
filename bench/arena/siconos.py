"""Siconos (Debian: libsiconos-numerics-dev) by way of siconos_solve.c, compiled into a folder of one's choice."""

import pathlib
import subprocess

import numpy as np

from environments import FRICTION, UNILATERAL

SOURCE = pathlib.Path(__file__).with_name("siconos_solve.c")
HEADERS = ["/usr/include/siconos", "/usr/include/siconos/numerics"]
SOLVERS = {1: ["lemke", "pgs"], 2: ["nsgs", "lemke"], 3: ["nsgs", "admm", "prox", "nsn"]}
LATE = -1


def build(folder):
    """The program's path, or None where it cannot be built."""
    program = pathlib.Path(folder, "siconos_solve")
    command = ["cc", "-O2", *(f"-I{header}" for header in HEADERS), str(SOURCE), "-o", str(program), "-lsiconos_numerics",
               "-lm"]
    try:
        done = subprocess.run(command, capture_output=True)
    except FileNotFoundError:
        return None
    return program if done.returncode == 0 else None


def version():
    asked = subprocess.run("dpkg-query -W -f '${Version}' libsiconos-numerics-dev", shell=True, capture_output=True, text=True)
    return f"Siconos {asked.stdout or '(version unknown)'}"


def contact_size(environments, law):
    """Rows of every contact if Siconos can treat all environments (1: an LCP), else 0."""
    kinds = np.concatenate([e.kinds for e in environments])
    if (kinds == UNILATERAL).all():
        return 1
    sizes = np.concatenate([e.cone_sizes for e in environments])
    if law != "coulomb" or (kinds != FRICTION).any() or (sizes != sizes[0]).any() or sizes[0] > 3:
        return 0
    alike = all((e.row_param.reshape(-1, sizes[0])[:, 1:] == e.row_param.reshape(-1, sizes[0])[:, 1:2]).all()
                for e in environments)
    return int(sizes[0]) if alike else 0


def solve(program, environments, size, solver, tolerance, max_iterations, seconds, folder):
    """For each environment (reaction, seconds, Siconos' return value: 0 is solved, LATE is no answer)."""
    into, outof = pathlib.Path(folder, "problems.bin"), pathlib.Path(folder, "answers.bin")
    with open(into, "wb") as file:
        np.array([size, len(environments)], "<i8").tofile(file)
        for e in environments:
            offsets, columns, values = e.with_compliance()
            np.array([e.rows, len(values)], "<i8").tofile(file)
            for array, kind in ((offsets, "<i8"), (columns, "<i8"), (values, "<f8"), (e.b, "<f8"),
                                (e.row_param[size - 1::size], "<f8")):
                np.ascontiguousarray(array, kind).tofile(file)
    subprocess.run([program, solver, repr(tolerance), str(max_iterations), repr(seconds), into, outof], check=True)
    answers = []
    with open(outof, "rb") as file:
        for e in environments:
            how, spent = int(np.fromfile(file, "<i8", 1)[0]), float(np.fromfile(file, "<f8", 1)[0])
            answers.append((np.fromfile(file, "<f8", e.rows), spent, how))
    return answers
