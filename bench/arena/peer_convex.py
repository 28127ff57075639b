"""Solvers of convex programs: Clarabel, with second-order cones, and qpax, with linear ones."""

import importlib.metadata
import importlib.util

import numpy as np
from answer_file import Answer
from environments import BOX, FREE, read_environments
from peer import Peer, one_by_one, shortest

MOST_ROWS = 300  # of a matrix whose eigenvalues are asked for, and of the matrices given to qpax
ROUNDING = 1e-9


def not_convex(problems):
    """Why the problems are no minimum, or None."""
    if problems.has_friction:
        return None if problems.law == "convex" else "Coulomb's law is no convex program"
    for environment in read_environments(problems.path):
        if environment.rows <= MOST_ROWS:
            matrix = environment.dense()
            size = np.abs(matrix).max(initial=0.0)
            if np.abs(matrix - matrix.T).max(initial=0.0) > ROUNDING * size:
                return "some matrix is not symmetric: no convex program"
            if environment.rows and np.linalg.eigvalsh(matrix)[0] < -ROUNDING * size:
                return "some matrix is not positive semidefinite: no convex program"
    return None


def installed(*modules):
    missing = [name for name in modules if importlib.util.find_spec(name) is None]
    return f"{missing[0]} is not installed (PyPI)" if missing else None


class Clarabel(Peer):
    name = "Clarabel"

    def prepare(self, folder, clock):
        reason = installed("clarabel", "scipy")
        self.version = "" if reason else importlib.metadata.version("clarabel")
        return reason

    def refuses(self, problems):
        return not_convex(problems)

    def load(self):
        import conic

        self.conic = conic

    def answer(self, path, law, setting, seconds, folder):
        def solve(environment):
            inner = []  # of the solving call, without forming the matrices that it is given

            def call():
                found = self.conic.solve(environment, setting, seconds)
                inner.append(found[1])
                return found

            (reaction, _, claimed), _ = shortest(call)
            return reaction, min(inner), claimed, None

        return one_by_one(read_environments(path), solve, seconds)


class Qpax(Peer):
    """min x'(A + R)x / 2 + b'x over G x <= h. In units with max|b| and the mean diagonal one, since it stops on absolute gaps."""

    name = "qpax"

    def prepare(self, folder, clock):
        reason = installed("qpax", "jax")
        self.version = "" if reason else importlib.metadata.version("qpax")
        return reason

    def refuses(self, problems):
        if problems.has_friction:
            return "has linear constraints alone; friction cones are none"
        if (problems.kinds == FREE).any():
            return "is given half lines and boxes alone"
        if problems.largest > MOST_ROWS:
            return f"is given at most {MOST_ROWS} rows, compiled for each size"
        return not_convex(problems)

    def load(self):
        import jax

        jax.config.update("jax_enable_x64", True)
        import qpax

        self.qpax, self.jax = qpax, jax

    def answer(self, path, law, setting, seconds, folder):
        run = self.jax.jit(lambda Q, q, A, b, G, h: self.qpax.solve_qp(Q, q, A, b, G, h, solver_tol=setting, max_iter=100))
        found = [self._solve(run, e) for e in read_environments(path)]
        reactions, spent, claimed, steps = zip(*found)
        return Answer(np.concatenate(reactions), np.array(spent), np.array(claimed), np.array(steps))

    def _solve(self, run, environment):
        matrix, b, n = environment.dense(), environment.b, environment.rows
        scale, size = np.diag(matrix).mean(), np.abs(b).max(initial=0.0)
        if not (scale > 0 and size > 0):
            return np.zeros(n), 0.0, False, 0
        unit, boxes = size / scale, np.flatnonzero(environment.row_kinds == BOX)
        bound = np.where(environment.row_kinds == BOX, environment.row_param, 0.0) / unit
        G, h = np.vstack((-np.eye(n), np.eye(n)[boxes])), np.concatenate((bound, bound[boxes]))
        half = (matrix + matrix.T) / (2 * scale)
        words = [self.jax.numpy.asarray(a) for a in (half, b / size, np.zeros((0, n)), np.zeros(0), G, h)]
        self.jax.block_until_ready(run(*words))  # compiles
        (x, _, _, _, converged, steps), spent = shortest(lambda: self.jax.block_until_ready(run(*words)))
        return np.asarray(x) * unit, spent, bool(converged), int(steps)


def entrants():
    yield Clarabel()
    yield Qpax()
