"""MuJoCo's three constraint solvers, by way of mujoco_rows.py: J and M in, forces out."""

import importlib.metadata
import importlib.util
import time

import h5py
import numpy as np
from answer_file import Answer
from judge import FRICTION
from peer import Peer, forget_peak, memory

ALIKE = 1e-6  # relative difference of compliances that are to be alike


def has_mujocos_compliance(path):
    """Returns true if mu_i^2 R_i is the same for all tangential axes of every contact, as MuJoCo's cost assumes."""
    with h5py.File(path) as batch:
        offsets, mu, R = batch["cone_row_ptr"][:], batch["row_param"][:], batch["R"][:]
        for cone in np.flatnonzero(batch["cone_kind"][:] == FRICTION):
            rows = slice(offsets[cone] + 1, offsets[cone + 1])
            product = mu[rows] ** 2 * R[rows]
            if not (mu[rows] > 0).all() or np.ptp(product) > ALIKE * product.max():
                return False
    return True


class MuJoCo(Peer):
    given = "J and M"

    def __init__(self, solver):
        self.solver, self.name = solver, f"MuJoCo {solver}"

    def prepare(self, folder, clock):
        if importlib.util.find_spec("mujoco") is None:
            return "mujoco is not installed (PyPI)"
        import mujoco_rows

        if mujoco_rows.build(folder) is None:
            return "no C compiler, or no headers of MuJoCo"
        self.version = importlib.metadata.version("mujoco")
        return None

    def refuses(self, problems):
        if problems.has_friction and problems.law != "convex":
            return "its law is the convex one, with compliance; the law here is Coulomb's"
        if not problems.has_jacobian:
            return "needs J and M, which the set does not have"
        if not problems.has_compliance:
            return "its law has compliance in every row; here is a row without"
        with h5py.File(problems.path) as batch:
            if np.ptp(np.diff(batch["env_dof_ptr"][:])) > 0:
                return "is given environments of one model; here they differ in degrees of freedom"
        if not has_mujocos_compliance(problems.path):
            return "its law ties the compliances of a contact's axes together; here they are others"
        return None

    def load(self):
        import mujoco_rows
        import systems

        self.peer, self.systems = mujoco_rows, systems

    def answer(self, path, law, setting, seconds, folder):
        found = self.systems.read(path)
        functions = self.peer.build(folder)
        forget_peak()
        before = memory("VmRSS")
        machine = self.peer.Peer(functions, found)
        start, spent = np.array([s.v_free for s in found]), np.inf
        machine.choose(self.solver, setting, False)
        for _ in range(3):
            machine.start(start)
            begin = time.process_time()
            machine.factor()
            if self.solver == "PGS":
                machine.project()
            machine.solve()
            spent = min(spent, time.process_time() - begin)
        reaction, iterations = machine.answer()
        machine.close()
        weight = memory("VmHWM")
        return Answer(reaction, np.full(len(found), spent / len(found)), None, iterations,
                      None if weight is None else weight - before)


def entrants():
    yield from (MuJoCo(solver) for solver in ("Newton", "CG", "PGS"))
