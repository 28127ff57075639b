"""MuJoCo's constraint solvers on recorded problems, by way of mujoco_solve.c, compiled into a folder of one's choice.

MuJoCo solves what its own pipeline left in mjData. Here a model of slide joints takes the place of the recorded one,
one body for each degree of freedom. Its kinematic tree is the one that the pattern of the recorded mass matrices
implies. MuJoCo thus factors M with the sparsity it has for the robot. M, J, free acceleration, target, compliance,
friction and types are written in; mj_island, mj_factorM, mj_projectConstraint and mj_fwdConstraint are MuJoCo's. The
judge decides if its answers are right.
"""

import ctypes
import pathlib
import subprocess

import mujoco
import numpy as np
from environments import BOX, FREE, FRICTION

SOURCE = pathlib.Path(__file__).with_name("mujoco_solve.c")
SOLVERS = {"Newton": mujoco.mjtSolver.mjSOL_NEWTON, "CG": mujoco.mjtSolver.mjSOL_CG, "PGS": mujoco.mjtSolver.mjSOL_PGS}
ITERATIONS = {"Newton": 100, "CG": 1000, "PGS": 1000}  # MuJoCo's default is 100 for all
ROW_TYPE = {FREE: mujoco.mjtConstraint.mjCNSTR_EQUALITY, BOX: mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON,
            FRICTION: mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC}
OTHER = mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON  # a unilateral row; which kind of one makes no difference to a solver
DOUBLES, INTEGERS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int)


class Problem(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("equality_count", "friction_loss_count", "row_count", "contact_count")]
    _fields_ += [(name, DOUBLES) for name in ("jacobian", "inertia", "free_acceleration", "target", "compliance",
                                              "friction_loss")]
    _fields_ += [(name, INTEGERS) for name in ("type", "id", "contact_row", "contact_size")]
    _fields_ += [(name, DOUBLES) for name in ("contact_mu", "contact_friction")]


def build(folder):
    """The library with the functions of mujoco_solve.c, or None where it cannot be built."""
    package = pathlib.Path(mujoco.__file__).parent
    library = next(iter(sorted(package.glob("libmujoco*"))), None)
    made = pathlib.Path(folder, "mujoco_solve.so")
    command = ["cc", "-O2", "-shared", "-fPIC", f"-I{package / 'include'}", str(SOURCE), str(library), f"-Wl,-rpath,{package}",
               "-o", str(made)]
    try:
        done = subprocess.run(command, capture_output=True)
    except FileNotFoundError:
        return None
    if done.returncode:
        return None
    functions = ctypes.CDLL(str(made))
    functions.peer_make.restype = ctypes.c_void_p
    return functions


def parents(inertias):
    """Parent of each degree of freedom, -1: none, in the tree in which every M's entries lie between ancestors."""
    coupled = np.any([M != 0 for M in inertias], axis=0)
    found = np.full(len(coupled), -1)
    for dof in range(len(coupled) - 1, 0, -1):
        ancestors = np.flatnonzero(coupled[dof, :dof])
        if len(ancestors):
            found[dof] = ancestors[-1]
            coupled[ancestors[-1], ancestors[:-1]] = True
    return found


def model_of(inertias, equality_rows, largest_rows, largest_contact=0):
    """A model whose sparse mass matrix has room for these; largest_contact: rows that a program is to expect of contacts."""
    tree, dofs = parents(inertias), len(inertias[0])
    children = [[] for _ in range(dofs + 1)]
    for dof, parent in enumerate(tree):
        children[parent].append(dof)

    def body(dof):
        inner = "".join(map(body, children[dof]))
        return (f'<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="j{dof}" type="slide"/>{inner}'
                "</body>")

    equalities = '<joint joint1="j0" active="false"/>' * equality_rows
    geom = f'<geom size="1" condim="{largest_contact}" contype="0" conaffinity="0"/>' if largest_contact else ""
    room = 1 + (8 * (6 * largest_rows**2 + 4 * dofs**2 + 8 * largest_rows * dofs) >> 20)  # [MiB]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><size memory="{room}M"/><option cone="elliptic" /><worldbody>{geom}'
        f'{"".join(map(body, children[-1]))}</worldbody><equality>{equalities}</equality></mujoco>')
    order = np.array([int(model.joint(j).name[1:]) for j in range(dofs)])
    if (order != np.arange(dofs)).any():
        raise ValueError("degrees of freedom are not in depth-first order")
    model.stat.meaninertia = np.mean([np.diag(M).mean() for M in inertias])
    return model


def as_c(array, kind):
    array = np.ascontiguousarray(array, kind)
    return array, array.ctypes.data_as(DOUBLES if kind == "f8" else INTEGERS)


class Peer:
    """MuJoCo's copy of these environments (robots.System), one mjData each."""

    def __init__(self, functions, systems):
        self.functions, self.systems = functions, systems
        equalities = max(int((s.kinds == FREE).sum()) for s in systems)
        self.model = model_of([s.M for s in systems], equalities, max(s.rows for s in systems))
        self.address = ctypes.c_void_p(self.model._address)
        self.data = (ctypes.c_void_p * len(systems))(*map(self._make, systems))
        self.rows = sum(s.rows for s in systems)

    def _make(self, system):
        model = self.model
        rows = np.repeat(np.arange(model.nv), model.M_rownnz)
        inertia = np.zeros_like(system.M)
        inertia[rows, model.M_colind] = system.M[rows, model.M_colind]
        if np.abs(np.tril(system.M) - inertia).max() > 0:
            raise ValueError("the tree has no room for an entry of M")
        cone_of = np.repeat(np.arange(len(system.kinds)), system.cone_sizes)
        contacts = np.flatnonzero(system.kinds == FRICTION)
        first, sizes = system.cone_offsets[contacts], system.cone_sizes[contacts]
        friction = np.zeros((len(contacts), 5))
        for contact, (row, size) in enumerate(zip(first, sizes)):
            mu = system.row_param[row + 1:row + size]
            friction[contact, :len(mu)] = mu
        # MuJoCo names two tangents, then torsion, then rolling; a contact of the recordings has them in that order.
        mu = friction[:, 0] * np.sqrt(system.compliance[first + 1] / system.compliance[first]) if len(contacts) else np.zeros(0)
        contact_of = np.searchsorted(contacts, cone_of)
        types = np.array([ROW_TYPE.get(int(kind), OTHER) for kind in system.row_kinds])
        ids = np.where(system.row_kinds == FRICTION, contact_of, cone_of)
        kept, fields = [], dict(equality_count=int((system.kinds == FREE).sum()), row_count=system.rows,
                                friction_loss_count=int((system.kinds == BOX).sum()), contact_count=len(contacts))
        for name, array in (("jacobian", system.J), ("inertia", system.M[rows, model.M_colind]),
                            ("free_acceleration", system.v_free), ("target", system.target), ("compliance", system.compliance),
                            ("friction_loss", np.where(system.row_kinds == BOX, system.row_param, 0)), ("contact_mu", mu),
                            ("contact_friction", friction)):
            array, fields[name] = as_c(array, "f8")
            kept.append(array)
        for name, array in (("type", types), ("id", ids), ("contact_row", first), ("contact_size", sizes)):
            array, fields[name] = as_c(array, "i4")
            kept.append(array)
        return self.functions.peer_make(self.address, ctypes.byref(Problem(**fields)))

    def close(self):
        for data in self.data:
            self.functions.peer_free(self.address, ctypes.c_void_p(data))

    def choose(self, solver, tolerance, warm):
        option = self.model.opt
        option.solver, option.tolerance, option.iterations = SOLVERS[solver], tolerance, ITERATIONS[solver]
        flag = int(mujoco.mjtDisableBit.mjDSBL_WARMSTART)
        option.disableflags = option.disableflags & ~flag if warm else option.disableflags | flag

    def start(self, accelerations):
        array, pointer = as_c(accelerations, "f8")
        self.functions.peer_start(self.address, self.data, len(self.data), pointer)

    def factor(self):
        self.functions.peer_factor(self.address, self.data, len(self.data))

    def project(self):
        self.functions.peer_project(self.address, self.data, len(self.data))

    def solve(self):
        self.functions.peer_solve(self.address, self.data, len(self.data))

    def answer(self):
        """(forces of all rows, iterations of each environment)."""
        force, iterations = np.zeros(self.rows), np.zeros(len(self.data), "i4")
        self.functions.peer_answer(self.data, len(self.data), force.ctypes.data_as(DOUBLES), iterations.ctypes.data_as(INTEGERS))
        return force, iterations
