"""Siconos, and the matrix solvers of Bullet and DART, by way of small programs around them."""

import pathlib
import shlex
import stat

import engine_programs
import numpy as np
import processes
import siconos
from answer_file import Answer
from environments import FRICTION, UNILATERAL, Environment, read_environments
from peer import Peer

ITERATIONS = 100000
MOST_ROWS = 300  # limit of dense pivoting
CALL_SECONDS = 0.002  # of warm calls, whose median counts
STEPS = [10, 100, 1000, 10000]


def under_scales(program, folder):
    """(a script that runs the program under weigh.py, where the peaks are noted)."""
    notes, script = pathlib.Path(folder, "program_notes"), pathlib.Path(folder, f"{pathlib.Path(program).name}_weighed")
    words = processes.weighed([program], notes)
    script.write_text(f"#!/bin/sh\nexec {' '.join(map(shlex.quote, words))} \"$@\"\n", encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    notes.unlink(missing_ok=True)
    return script, notes


def least(rows):
    """One contact of so many rows that is pressed on: the memory of a program with next to nothing to do."""
    kind = UNILATERAL if rows == 1 else FRICTION
    return Environment(np.arange(rows + 1), np.arange(rows), np.ones(rows), -np.eye(rows)[0], np.zeros(rows), np.array([kind]),
                       np.array([0, rows]), np.r_[0, np.full(rows - 1, 0.5)])


class Siconos(Peer):
    def __init__(self, solver):
        self.solver, self.name = solver, f"Siconos {solver}"

    def prepare(self, folder, clock):
        if siconos.build(folder) is None:
            return "libsiconos-numerics-dev or a C compiler is not installed"
        self.version = siconos.version().removeprefix("Siconos ")
        return None

    def refuses(self, problems):
        environments = read_environments(problems.path)
        size = siconos.contact_size(environments, problems.law)
        if not size:
            return ("solves Coulomb's law and complementarity problems; the law here is convex" if problems.law != "coulomb" else
                    "its contacts have one size of 2 or 3 rows and one mu; here are other cones")
        if self.solver not in siconos.SOLVERS[size]:
            return f"is not called for contacts of {size} row{'s' * (size > 1)}"
        return None

    def answer(self, path, law, setting, seconds, folder):
        environments = read_environments(path)
        size = siconos.contact_size(environments, law)
        program, notes = under_scales(pathlib.Path(folder, "siconos_solve"), folder)
        siconos.solve(program, [least(size)], size, self.solver, setting, ITERATIONS, seconds, folder)
        idle = processes.peak(notes)
        found = siconos.solve(program, environments, size, self.solver, setting, ITERATIONS, seconds, folder)
        reactions, spent, how = zip(*found)
        return Answer(np.concatenate(reactions), np.array(spent), np.array(how) == 0, None, processes.peak(notes) - idle,
                      siconos.LATE in how)


class Engine(Peer):
    """A solver of boxed complementarity problems inside a physics engine."""

    def __init__(self, program, solver):
        self.program, self.solver = program, solver
        self.name, self.iterative = f"{program.removesuffix(' f64')} {solver}", solver == "pgs"
        self.takes_boxes = solver != "lemke"  # which leaves bounds and findex out

    def prepare(self, folder, clock):
        built = pathlib.Path(folder, self.program.replace(" ", "_"))
        if not built.exists() and engine_programs.build(self.program, folder) is None:
            return f"{self.program.split()[0]}'s headers, pkg-config or a C++ compiler is not installed"
        self.version = engine_programs.version(self.program).rpartition(" ")[2]
        return None

    def refuses(self, problems):
        if problems.has_friction and not problems.is_boxed:
            return "its friction is boxed, axis by axis: another law than either of the cones'"
        if not problems.is_pushed:
            return "is given rows that push and do not pull; here are others"
        if problems.largest > MOST_ROWS:
            return f"is given at most {MOST_ROWS} rows"
        return None

    def settings(self, goal):
        return STEPS if self.iterative else [1000]

    def answer(self, path, law, setting, seconds, folder):
        import boxed

        environments = read_environments(path)
        program, notes = under_scales(pathlib.Path(folder, self.program.replace(" ", "_")), folder)
        into = pathlib.Path(folder, "boxed.bin")

        def run(chosen):
            engine_programs.write(into, [engine_programs.boxed_records(boxed.of_environment(e)) for e in chosen])
            return engine_programs.solve(program, self.solver, int(setting), CALL_SECONDS, into, [e.rows for e in chosen], folder)

        run([least(1)])
        idle = processes.peak(notes)
        reactions, spent, _, how = zip(*run(environments))
        claimed = None if self.iterative else np.array(how) == engine_programs.SOLVED
        steps = np.full(len(how), int(setting)) if self.iterative else None
        return Answer(np.concatenate(reactions), np.array(spent), claimed, steps, processes.peak(notes) - idle,
                      engine_programs.LATE in how)


def entrants():
    yield from (Siconos(solver) for solver in ("nsgs", "admm", "prox", "nsn", "lemke", "pgs"))
    yield from (Engine(program, solver) for program in ("Bullet f64", "DART") for solver in ("dantzig", "pgs", "lemke"))
