"""BatchedSimulation(engine="lanes"): whole steps of one model in the lanes of vectors, without MuJoCo's step."""

import collections.abc
import copy

import mujoco
import numpy as np

from .. import _core
from ..core.arguments import whole
from ..core.arrays import STATUS_DTYPE, framework_of, take
from ..core.solution import CODES, SOLVED
from ..core.streams import handle_of
from .data import check_data, count_of, numbers_of
from .resident import array_of
from .robots import UnsupportedModel, description, has_fixed_tendons
from .varied import NAMES, VariedConstants, checked_names

_TENDONS = ("ten_length", "ten_velocity")
_STATE = ("qpos", "qvel", "ctrl", "qfrc_applied", "qacc", "time")
_PRECISIONS = {"float64": True, "float32": False}


class StatesAsData(collections.abc.Sequence):
    """A mujoco.MjData of each simulation, filled when it is asked for: its state, and what mj_forward makes of it, with
    the simulation's own constants.

    A change of it changes nothing here: `simulation.take(i)` reads its state back.
    """

    def __init__(self, simulation):
        self._simulation, self._made = simulation, {}

    def __len__(self):
        return len(self._simulation)

    def __getitem__(self, i):
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(len(self)))]
        i = self._simulation._place("data", i)
        one = self.made(i)
        self._simulation._fill(i, one)
        return one

    def made(self, i):
        """The object of a simulation, as it is."""
        if i not in self._made:
            self._made[i] = mujoco.MjData(self._simulation.model)
        return self._made[i]


class LanesSimulation:
    """n simulations of one model, whole steps of which are made in the lanes of vectors: what
    BatchedSimulation(model, n, engine="lanes") makes (docs/howto/robots_in_lanes.md). The bits of one depend on
    its own state, controls and constants alone. Neither n, the others, threads nor the width of vectors reach them.

    model: mujoco.MjModel, read once: what is changed in it later is not seen.
    n: how many simulations, or a list of mujoco.MjData of that model, whose states they begin with.
    tolerance: on the relative residual of each simulation's rows [-]; max_iterations: Newton steps of a solve.
    threads: of the CPU; 0: all cores. dtype: "float64" or "float32", which has a tolerance of at least 1e-5.
    observes_bodies: keep `observed`, places, inertias, velocities and contact forces of bodies.
    varies: names of constants of which each simulation has its own, in `varied`.
    device: "cpu", or "cuda", "cuda:1": a GPU. Its arrays stay there, as DeviceArray, which copies what is read or written
        on the host, and which torch.from_dlpack and others share. A step is queued and not waited for. No GPU has run it yet.

    Attributes: model; observed and varied, dicts of arrays. Arrays over the simulations' own memory may be written between
    steps. They are qpos (n, nq), ctrl (n, nu), time (n,), and qvel, qfrc_applied and qacc (n, nv).

    Raises UnsupportedModel, a ValueError, for what is not stepped in lanes: the message says why.
    """

    def __init__(self, model, n, *, engine="lanes", tolerance=None, max_iterations=100, threads=0, dtype="float64",
                 observes_bodies=False, varies=(), device="cpu"):
        del engine
        if str(dtype) not in _PRECISIONS:
            raise ValueError(f'dtype: expected "float64" or "float32", got {dtype!r}')
        wide = _PRECISIONS[str(dtype)]
        varies = checked_names(model, varies)
        tolerance = (1e-6 if wide else 1e-4) if tolerance is None else float(tolerance)
        self._made_by = dict(tolerance=tolerance, max_iterations=max_iterations, threads=threads, dtype=str(dtype),
                             observes_bodies=bool(observes_bodies), varies=varies, device=str(device))
        given = list(n) if not isinstance(n, (int, np.integer)) else []
        count = len(given) if given else whole("n", n)
        if count < 1:
            raise ValueError(f"n: expected at least one simulation, got {count}")
        self.model = model
        what, self._pairs = description(model)
        self._core = _core.ArticulatedBatch(what, count, tolerance, whole("max_iterations", max_iterations),
                                            whole("threads", threads), bool(observes_bodies),
                                            [NAMES[name] for name in varies], wide, str(device))
        self._varied = VariedConstants(model, varies, self._pairs, self._core, count)
        self._own_model, self._stream = None, 0
        widths = dict(qpos=(model.nq,), ctrl=(model.nu,), time=())
        self._state = {name: array_of(self._core, name, (count, *widths.get(name, (model.nv,)))) for name in _STATE}
        self._observed = self._observed_arrays(count) if observes_bodies else {}
        self._data = StatesAsData(self)
        for i, one in enumerate(given):
            check_data(model, i, one)
            self._data._made[i] = one
        if given:
            self.take()

    qpos = property(lambda self: self._state["qpos"], doc="Coordinates (n, nq); may be written.")
    qvel = property(lambda self: self._state["qvel"], doc="Velocities (n, nv); may be written.")
    ctrl = property(lambda self: self._state["ctrl"], doc="Controls (n, nu); may be written.")
    qfrc_applied = property(lambda self: self._state["qfrc_applied"], doc="Further forces (n, nv); may be written.")
    qacc = property(lambda self: self._state["qacc"], doc="Last accelerations (n, nv), which the next solves start from.")
    time = property(lambda self: self._state["time"], doc="Time of each simulation's state (n,); may be written.")
    device = property(lambda self: self._core.device, doc="Name of the device.")

    @property
    def observed(self):
        """Arrays (n, ...) of bodies as the last step of a call has left them, a dict by the names of mjData. Empty without
        observes_bodies. They are the simulations' own memory, which may be written and which no step reads.

        xpos, xipos, cinert, cvel, qfrc_actuator, cfrc_ext, ten_length and ten_velocity are those of mj_step followed by
        mj_rnePostConstraint. With Euler they belong to the state before the step, with RK4 to the last stage. They are
        zero before the first step, and reset() leaves them: see forward(). A simulation that fails keeps its old ones.
        """
        return dict(self._observed)

    @property
    def varied(self):
        """Constants (n, ...) of each simulation, a dict by the names of mjModel that `varies` has. They begin with the
        model's and may be written between steps. reset() leaves them.

        There are body_mass, body_inertia, geom_friction, pair_friction, actuator_gainprm, actuator_biasprm, dof_damping,
        dof_armature and dof_frictionloss. The first three of gainprm and biasprm are there (n, nu, 3). They act as in
        MuJoCo after mj_setConst, but that inverse weights, which compliances of rows follow, stay the model's.

        A simulation with a number that is not finite, or below 0, stays where it is: `failed`. Gains and biases may be
        negative, and friction is at least 1e-5.
        """
        return dict(self._varied.arrays)

    def model_of(self, i):
        """A copy of the model with a simulation's own constants, and what MuJoCo derives from them: masses of subtrees, and
        dof_M0 of simple bodies."""
        own = copy.copy(self.model)
        self._varied.put(self._place("model_of", i), own)
        return own

    def __len__(self):
        return len(self._state["time"])

    def __repr__(self):
        return f"<stiction.mujoco.BatchedSimulation of {len(self)} in lanes, {self._made_by['dtype']}>"

    def __reduce__(self):
        state = {name: getattr(self, name).copy() for name in _STATE}
        for name in ("observed", "varied"):
            state[name] = {key: array.copy() for key, array in getattr(self, name).items()}
        return _remade, (self.model, len(self), self._made_by, state)

    @property
    def data(self):
        """A mujoco.MjData of each simulation, filled when it is asked for: see StatesAsData."""
        return self._data

    def step(self, ctrl=None, nstep=1, active=None, stream=None):
        """Advances by nstep time steps, as mujoco.mj_step does. ctrl (n, nu): set before; None: left as it is. On a device
        another framework's array of its memory is taken without the host.
        active: bool (n,), which simulations to step; None: all.
        stream: of a device, as stiction.Solver.solve has it; None: the current one of ctrl's framework, else the last.

        A simulation with a number that is not finite, or would become so, or with a constant out of range stays where it
        is: `failed`.
        Raises TypeError or ValueError for arrays of another shape, and for those of a framework that are of another type
        or device.
        """
        nstep, mask = count_of(nstep), self._mask_of(active)
        self._follow(stream, ctrl)
        if ctrl is not None:
            self._control(ctrl)
        self._varied.renew()
        self._core.step(nstep, mask, self._stream)

    def _control(self, ctrl):
        if self.device != "cpu" and not isinstance(ctrl, np.ndarray) and hasattr(ctrl, "__dlpack__"):
            place = "cpu" if self.device == "emulated" else self.device
            self._core.copy_ctrl(take("ctrl", ctrl, str(self.ctrl.dtype), self.ctrl.shape, place), self._stream)
            return
        ctrl = np.asarray(ctrl)
        if ctrl.shape != self.ctrl.shape:
            raise ValueError(f"ctrl: expected {self.ctrl.shape}, got {ctrl.shape}")
        self.ctrl[:] = ctrl

    def _follow(self, stream, ctrl=None):
        framework = framework_of(ctrl)
        if self.device.startswith("cuda") and (stream is not None or framework.has_streams):
            self._stream = handle_of(stream, framework, self.device)

    def forward(self, active=None, stream=None):
        """Evaluates at the present states without a step, as mujoco.mj_forward followed by mj_rnePostConstraint: fills
        `observed` and `status`, and leaves the rest. active: bool (n,), which simulations; None: all. stream: as of a
        step."""
        mask = self._mask_of(active)
        self._follow(stream)
        self._varied.renew()
        self._core.forward(mask, self._stream)

    def synchronize(self):
        """Returns when all steps are done: for who shares memory of a device. Reading an array here waits by itself."""
        self._core.synchronize()

    def read(self, name):
        """An array of all simulations, (n, ...), a copy. State, time and `observed` arrays are there. For others, such as
        "xpos" without observes_bodies, mj_forward runs in every simulation, one after the other.

        Raises ValueError for names that mjData has not, and UnsupportedModel for lengths of tendons that are not fixed
        where bodies are observed.
        """
        if name in self._observed:
            return self._observed[name].copy()
        if self._observed and name in _TENDONS:
            raise UnsupportedModel(f'engine="lanes" does not compute {name} of tendons that are not fixed: '
                                   'use engine="mujoco"')
        if name in _STATE:
            return getattr(self, name).copy()
        if name == "qacc_warmstart":
            return self.qacc.copy()
        if not isinstance(getattr(self._data.made(0), name, None), np.ndarray):
            raise ValueError(f"name: expected an array of mujoco.MjData, got {name!r}")
        state = {name: np.asarray(array) for name, array in self._state.items()}
        return np.array([getattr(self._fill(i, self._data.made(i), state), name) for i in range(len(self))])

    def take(self, simulations=None):
        """Reads states back from `data`, of a list of simulations, of one, or of all."""
        chosen = [simulations] if isinstance(simulations, (int, np.integer)) else numbers_of(simulations, len(self))
        made = [self._data.made(i) for i in chosen]
        for name, array in self._state.items():
            if chosen:
                array[chosen] = [getattr(one, "qacc_warmstart" if name == "qacc" else name) for one in made]

    def reset(self, simulations=None):
        """Resets states as mujoco.mj_resetData does, of a list of simulations or of all."""
        mask = np.zeros(len(self), np.uint8)
        mask[numbers_of(simulations, len(self))] = 1
        self._core.reset(_core.Array(mask), self._stream)

    def reset_warm_start(self, simulations=None):
        """Lets the next solve start from no acceleration, of a list of simulations or of all."""
        self.qacc[numbers_of(simulations, len(self))] = 0

    @property
    def status(self):
        """Records of the solves of the last step or forward, one per simulation, as stiction.Solution.status; a copy. With
        RK4 the residual is the largest of four."""
        return self._records().copy()

    @property
    def failed(self):
        """Indices of simulations whose last step or forward was not made, because a number was not finite."""
        code = self._records()["code"]
        return np.flatnonzero((code == _NUMERICAL) | (code == _INVALID))

    @property
    def solved(self):
        """True where a simulation's last solves all met the tolerance (n,)."""
        return self._records()["code"] == SOLVED

    def hash(self):
        """Hash of all coordinates and velocities."""
        return self._core.hash()

    def probe(self):
        """Computes what a step does at the present states: a dict of arrays, for tests, and for eyes.

        M (n, nv, nv), lower triangles; bias, passive, actuator, qacc_smooth, qacc (n, nv); rows and contacts (n,), how many.
        Rows have J (n, most, nv), aref and R (n, most). Contacts have distance, point and normal, contact (n, most, 7),
        and geoms (n, most, 2).
        """
        self._varied.renew()
        found, n, nv = self._core.probe(), len(self), self.model.nv
        rows, contacts = found.pop("most_rows"), found.pop("most_contacts")
        shapes = dict(M=(n, nv, nv), J=(n, rows, nv), aref=(n, rows), R=(n, rows), contact=(n, contacts, 7),
                      pair=(n, contacts), rows=(n,), contacts=(n,))
        found = {name: array.reshape(shapes.get(name, (n, nv))) for name, array in found.items()}
        pairs = np.array([pair[:2] for pair in self._pairs], int).reshape(-1, 2)
        found["geoms"] = pairs[found.pop("pair")] if len(pairs) else np.zeros((n, contacts, 2), int)
        return found

    def _observed_arrays(self, count):
        model = self.model
        shapes = {name: (model.nbody, width) for name, width in
                  dict(xpos=3, xipos=3, cinert=10, cvel=6, cfrc_ext=6).items()}
        shapes["qfrc_actuator"] = (model.nv,)
        if has_fixed_tendons(model):
            shapes.update(dict.fromkeys(_TENDONS, (model.ntendon,)))
        return {name: array_of(self._core, name, (count, *shape)) for name, shape in shapes.items()}

    def _records(self):
        return self._core.array("status").view(STATUS_DTYPE)[:, 0]

    def _place(self, asked, i):
        if not -len(self) <= i < len(self):
            raise IndexError(f"{asked}: expected a simulation in 0..{len(self) - 1}, got {i}")
        return int(i) % len(self)

    def _mask_of(self, active):
        if active is None:
            return None
        chosen = np.ascontiguousarray(active, bool)
        if chosen.shape != (len(self),):
            raise ValueError(f"active: expected bool ({len(self)},), got {chosen.shape}")
        return _core.Array(chosen.view(np.uint8))

    def _fill(self, i, one, state=None):
        state = state or self._state
        for name in ("qpos", "qvel", "ctrl", "qfrc_applied"):
            getattr(one, name)[:] = state[name][i]
        one.qacc_warmstart[:], one.time = state["qacc"][i], state["time"][i]
        model = self.model
        if self._varied.arrays:
            model = self._own_model = self._own_model or copy.copy(self.model)
            self._varied.put(i, model)
        mujoco.mj_forward(model, one)
        return one


_NUMERICAL, _INVALID = CODES.index("numerical"), CODES.index("invalid_input")


def _remade(model, n, made_by, state):
    made = LanesSimulation(model, n, **made_by)
    for kept in ("observed", "varied"):
        for name, array in state.pop(kept).items():
            getattr(made, kept)[name][:] = array
    for name, array in state.items():
        getattr(made, name)[:] = array
    return made
