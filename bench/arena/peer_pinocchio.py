"""Pinocchio's constraint solvers, ADMM and PGS (PyPI: pin, from version 4 on), on given matrices."""

import importlib.metadata
import importlib.util

import numpy as np
from environments import FRICTION, read_environments
from peer import Peer, one_by_one, shortest

ITERATIONS = 10000
# The measure that it stops by; the other one is off. PGS calls its first sweep converged by the absolute one (pin 4.1.0), and
# ADMM's absolute one is the nearer to the judge's.
MEASURE = {"ADMM": "absolute", "PGS": "relative"}


class Pinocchio(Peer):
    def __init__(self, solver):
        self.solver, self.name = solver, f"Pinocchio {solver}"

    def prepare(self, folder, clock):
        if importlib.util.find_spec("pinocchio") is None:
            return "pin is not installed (PyPI)"
        self.version = importlib.metadata.version("pin")
        self.load()
        name = f"{self.solver}ConstraintSolver"
        return None if hasattr(self.pin, name) else f"pin {self.version} has no {name}"

    def load(self):
        import pinocchio

        self.pin = pinocchio

    def refuses(self, problems):
        if not problems.has_friction:
            return "is given contacts of three rows; here are none"
        if self.solver == "PGS" and problems.law == "convex":
            return "solves Coulomb's law; the law here is convex"
        for environment in read_environments(problems.path):
            if (environment.kinds != FRICTION).any() or (environment.cone_sizes != 3).any():
                return "is given contacts of three rows; here are other cones"
            mu = environment.row_param.reshape(-1, 3)
            if (mu[:, 1] != mu[:, 2]).any():
                return "a contact has one mu; here the axes differ"
        return None

    def answer(self, path, law, setting, seconds, folder):
        return one_by_one(read_environments(path), lambda e: self._solve(e, law, setting), seconds)

    def _solve(self, environment, law, tolerance):
        """Units are taken out as for Clarabel: max|b| and the mean diagonal become one."""
        pin, n = self.pin, environment.rows
        normal_last = np.arange(n).reshape(-1, 3)[:, [1, 2, 0]].ravel()
        matrix = environment.dense()
        scale, size = np.diag(matrix).mean(), np.abs(environment.b).max(initial=0.0)
        if not (scale > 0 and size > 0):
            return np.zeros(n), 0.0, False, 0
        models, data = self._contacts(environment.row_param[1::3])
        settings, result = getattr(pin, f"{self.solver}SolverSettings")(), getattr(pin, f"{self.solver}SolverResult")()
        for kind in ("absolute", "relative"):
            for of in ("feasibility", "complementarity"):
                setattr(settings, f"{kind}_{of}_tol", tolerance if kind == MEASURE[self.solver] else 0.0)
        settings.solve_ncp, settings.max_iterations = law == "coulomb", ITERATIONS
        given = np.asfortranarray(matrix[np.ix_(normal_last, normal_last)] / scale)
        motion = environment.b[normal_last] / size

        def run():
            result.reset()
            solver = getattr(pin, f"{self.solver}ConstraintSolver")(n)
            return solver.solve(pin.DelassusOperatorDense(given), motion, models, data, settings, result)

        _, spent = shortest(run)
        found, reaction = np.zeros(n), np.empty(n)
        result.retrievePrimalSolution(found)
        reaction[normal_last] = found * (size / scale)
        return reaction, spent, bool(result.converged), int(result.iterations)

    def _contacts(self, friction):
        """Contacts of a single body: only their number and their mu reach the solver."""
        pin = self.pin
        model = pin.Model()
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
        whole = model.createData()
        pin.forwardKinematics(model, whole, pin.neutral(model))
        models, data = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for mu in friction:
            contact = pin.PointContactConstraintModel(model, joint)
            contact.setFriction(float(mu))
            models.append(pin.ConstraintModel(contact))
            data.append(models[len(models) - 1].createData())
        for one, its in zip(models, data):
            one.calc(model, whole, its)
        return models, data


def entrants():
    yield Pinocchio("ADMM")
    yield Pinocchio("PGS")
