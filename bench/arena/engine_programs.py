"""Physics engines by way of bullet_solve.cpp and dart_solve.cpp, compiled into a folder of one's choice."""

import pathlib
import shlex
import subprocess

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
# Name: source, pkg-config module, libraries to link if pkg-config names more than is needed.
PROGRAMS = {
    "Bullet f64": ("bullet_solve.cpp", "bullet-float64", None),
    "DART": ("dart_solve.cpp", "dart", ["-ldart", "-ldart-external-odelcpsolver"]),
}
SOLVED, LATE, CRASHED = 0, -1, -2


def ask(*words):
    """Returns pkg-config's output, or None."""
    try:
        done = subprocess.run(["pkg-config", *words], capture_output=True, text=True)
    except FileNotFoundError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def build(name, folder):
    """The program's path, or None where it cannot be built."""
    source, module, libraries = PROGRAMS[name]
    flags = ask("--cflags", module)
    if flags is None:
        return None
    program = pathlib.Path(folder, name.replace(" ", "_"))
    command = ["c++", "-O2", *shlex.split(flags), "-std=c++17", str(HERE / source), "-o", str(program),
               *(libraries or shlex.split(ask("--libs", module)))]
    try:
        done = subprocess.run(command, capture_output=True)
    except FileNotFoundError:
        return None
    return program if done.returncode == 0 else None


def version(name):
    return f"{name} {ask('--modversion', PROGRAMS[name][1])}"


def boxed_records(problem):
    """The bytes of a boxed LCP that engine_run.hpp reads."""
    numbers = [np.ascontiguousarray(array, "<f8").tobytes() for array in (problem.A, problem.b, problem.lo, problem.hi)]
    return b"".join([np.array([len(problem.b)], "<i8").tobytes(), *numbers, problem.findex.astype("<i8").tobytes()])


def write(path, records):
    path.write_bytes(np.array([len(records)], "<i8").tobytes() + b"".join(records))
    return path


def solve(program, solver, iterations, seconds, path, rows, folder):
    """For each environment (reaction, seconds of the solving call, seconds of forming, how); `rows` are their sizes."""
    outof = pathlib.Path(folder, "answers.bin")
    subprocess.run([program, solver, str(iterations), repr(seconds), path, outof], check=True)
    answers = []
    with open(outof, "rb") as file:
        for count in rows:
            how = int(np.fromfile(file, "<i8", 1)[0])
            solving, forming = np.fromfile(file, "<f8", 2)
            answers.append((np.fromfile(file, "<f8", count), float(solving), float(forming), how))
    return answers
