"""MuJoCo with stiction as its constraint solver: n simulations of one model, whose constraints are solved in one call.

    simulation = stiction.mujoco.BatchedSimulation(model, 1024, tolerance=1e-6)
    simulation.step(ctrl)                 # ctrl (1024, nu); all of MuJoCo's integrators
    simulation.data[3].qpos               # each simulation is an ordinary mujoco.MjData

MuJoCo collects the rows (contacts, limits, friction loss, equalities), and stiction solves the convex problem that
they form. qacc, efc_force, efc_state and qfrc_constraint go back to where MuJoCo's own solver writes them.
docs/howto/mujoco.md.
"""

import copy
import time

import mujoco
import numpy as np

from .. import _core
from ..core.arguments import each_count, each_not_negative, spread_over, whole
from ..core.arrays import STATUS_DTYPE
from ..core.solution import SOLVED, Solution
from ..core.solver import Solver
from .batch import batch_of, gather, remade, take_answers
from .data import Simulations, count_of, numbers_of, other_options, refuse
from .derivative import pull
from .hold import Held
from .lanes import LanesSimulation
from .memory_layout import LayoutError, address, handlers, layout, place_of
from .metric import Metric
from .robots import UnsupportedModel

__all__ = ["BatchedSimulation", "LanesSimulation", "LayoutError", "UnsupportedModel", "gather"]

_DISCRETE = getattr(mujoco.mjtIntegrator, "mjINT_DISCRETE", None)  # since 3.13


class BatchedSimulation:
    """n simulations of one model, stepped together. Each one's bits depend on its own state, controls and history
    alone: not on n, on the others, on threads.

    model: mujoco.MjModel; shared, and read at every step, so that its options may be changed between steps.
    n: how many simulations; or a list of mujoco.MjData of that model, used where they are.
    solver: "auto", "newton", ... with tolerance and max_iterations as in stiction.Solver. Or a stiction.Solver on the
        CPU (its options, statistics and callback are used). Or "mujoco": MuJoCo's own, for comparison.
    tolerance: on the relative residual of each simulation's rows [-].
    threads: of the CPU, for MuJoCo's functions and for the solver; 0: all cores.
    warm_start: 0: solves start from the free acceleration and no reaction. Else "auto" starts a model of up to 64
        degrees of freedom from qacc_warmstart, as MuJoCo does. Other solvers start a constraint from this part of its
        last reaction, by geoms and joints.
    engine: "mujoco", whose stages are called on each simulation; or "lanes", which steps simulations side by side in
        the lanes of vectors. It makes a LanesSimulation, which has options of its own.
    hold_failed: put a simulation back to its last good state where a step ends in NaN, or MuJoCo resets it for that.
        `failed` has their indices. Costs a copy of the states.

    Copied deeply or pickled, it is one with a model and data of its own. It goes on with the bits of the first, unless
    solves start from stored reactions (starts_from_reactions): the copy's next solve starts without.

    Attributes: model; data, a sequence of mujoco.MjData; solver. seconds is a dict of wall-clock seconds since the
    last `clear`. Its keys are "smooth" (MuJoCo up to the solve), "assemble" (rows into the batch), "solve" and
    "advance" (answers back, sensors, the integrator).

    Raises ValueError for models that cannot be stepped so. They are RK4 with actuator states, plugins, delays,
    plasticity or sleeping bodies, noslip iterations, incremental potentials (mjENBL_IPC), Python callbacks (mjcb_*).
    """

    def __new__(cls, model, n, *, engine="mujoco", **options):
        if engine not in ("mujoco", "lanes"):
            raise ValueError(f'engine: expected "mujoco" or "lanes", got {engine!r}')
        return LanesSimulation(model, n, **options) if engine == "lanes" else super().__new__(cls)

    def __init__(self, model, n, *, engine="mujoco", solver="auto", tolerance=1e-6, max_iterations=1000, threads=0,
                 warm_start=0.95, hold_failed=False):
        del engine  # the arguments read by __new__
        self._made_by = dict(solver=solver, tolerance=tolerance, max_iterations=max_iterations, threads=threads,
                             warm_start=warm_start, hold_failed=hold_failed)
        self._model = model
        is_given = isinstance(n, (list, tuple, Simulations))
        self._data = Simulations(model, n if is_given else [mujoco.MjData(model) for _ in range(whole("n", n))])
        if not len(self._data):
            raise ValueError(f"n: expected at least one simulation, got {0 if is_given else n}")
        if not 0 <= float(warm_start) <= 1:
            raise ValueError(f"warm_start: expected a number in [0, 1], got {warm_start}")
        self._uses_mujoco = isinstance(solver, str) and solver == "mujoco"
        if isinstance(solver, Solver):
            if solver.device != "cpu":
                raise ValueError(f"solver: expected one on cpu, where MuJoCo is, got one on {solver.device}")
            self.solver = solver
        else:
            self.solver = Solver(solver="auto" if self._uses_mujoco else solver, tolerance=tolerance,
                                 max_iterations=max_iterations, threads=threads)
        refuse(model)
        mujoco.mj_forward(model, self.data[0])  # in the module that turns MuJoCo's errors into exceptions
        self._layout = layout(model, self.data[0])
        self._core = _core.MujocoSimulations(
            self._layout, address("mj_mulJacTVec"), address("mj_integratePos"), handlers(), model._address,
            [one._address for one in self.data], self.solver._options, float(warm_start))
        self._data._core = self._core
        self._warm = float(warm_start) > 0
        self._stages = _core.mujoco_stages()  # our own by name, and MuJoCo's functions that were called
        self._places = {}
        self._plans = {}  # a step, as the core takes it
        self._active = None
        self._held = Held(model, len(self._data)) if hold_failed else None
        self._metric = self._limits = None
        # Sensors of accelerations and forces. MuJoCo's stages leave it to mj_forward to mark those as new.
        feels = (np.asarray(model.sensor_needstage) == int(mujoco.mjtStage.mjSTAGE_ACC)).any()
        self._sensor_stages = ("renew_forces", "mj_sensorAcc") if feels else ("mj_sensorAcc",)
        self.seconds = {}
        self.clear()

    def __len__(self):
        return len(self.data)

    def __reduce__(self):
        return remade, (type(self), self._model, list(self._data), self._made_by, self._limits, self._held)

    def __deepcopy__(self, memo):
        model, made_by, limits, held = copy.deepcopy((self._model, self._made_by, self._limits, self._held), memo)
        return remade(type(self), model, self._data, made_by, limits, held)

    @property
    def model(self):
        """The mujoco.MjModel of all simulations. Its options may be changed, the model may not."""
        return self._model

    @property
    def data(self):
        """The mujoco.MjData of each simulation, a sequence; see Simulations for elements that may replace them."""
        return self._data

    def __repr__(self):
        solver = "MuJoCo's own solver" if self._uses_mujoco else repr(self.solver)
        return f"<stiction.mujoco.BatchedSimulation of {len(self)}, {solver}>"

    @property
    def failed(self):
        """Indices of simulations whose last step failed and was taken back; None without hold_failed."""
        return None if self._held is None else np.flatnonzero(self._held.failed)

    @property
    def starts_from_reactions(self):
        """True if solves start from the reactions of the step before, which are kept here and not in mjData."""
        return self._warm and not self._uses_mujoco and not self._core.starts_from_accelerations()

    # -- stepping -----------------------------------------------------------------------------------------------------

    def step(self, ctrl=None, nstep=1, active=None):
        """Advances by nstep time steps, as mujoco.mj_step does. ctrl (n, nu): set before; None: left as it is.
        active: bool (n,), which simulations to step; None: all.

        Ctrl-C ends a call of many steps, between two that all simulations have taken. If MuJoCo itself gives up, for
        too small an arena, say, stiction.Error names the simulation; others may be some steps further then.
        """
        nstep = count_of(nstep)
        self._activate(active)
        if ctrl is not None:
            self._write_ctrl(ctrl)
        if self._held is None:
            return self._advance(nstep)
        chosen = self._held.before(self.data, self._active)
        self._activate(chosen)
        self._advance(nstep)
        self._held.after(self.data, chosen)
        self.reset_warm_start(self.failed)

    def _advance(self, nstep):
        opt = self.model.opt
        if opt.integrator != _DISCRETE:
            return self._run_solves(("step", opt.integrator, opt.enableflags), self._step_stages, nstep)
        for _ in range(nstep):
            self._constrain_discretely(check=True)
            start = time.perf_counter()
            # Its own step: velocities by qacc, without damping once more.
            with other_options(self.model, disable=mujoco.mjtDisableBit.mjDSBL_EULERDAMP):
                self._run(*self._stages_after_solve(), "mj_Euler")
            self.seconds["advance"] += time.perf_counter() - start

    def forward(self, active=None):
        """Forward dynamics without a step, as mujoco.mj_forward: accelerations at the present state."""
        self._activate(active)
        if self.model.opt.integrator == _DISCRETE:
            self._constrain_discretely(check=False)
            self._run(*self._sensor_stages)
        else:
            self._run_solves(("forward", self.model.opt.enableflags),
                             lambda: ((self._stages_before_solve(check=False), self._sensor_stages),))

    def run(self, *functions, active=None):
        """Calls functions of MuJoCo's C interface that take a model and a data, by name, on every simulation."""
        self._activate(active)
        self._run(*functions)

    def read(self, name):
        """An array of mjData's of all simulations, such as "qpos": (n, nq); a copy, made without an object for each.

        Raises ValueError for names that are no arrays of numbers as large in all simulations.
        """
        if name not in self._places:
            self._places[name] = place_of(self.model, self.data[0], name)
        offset, shape = self._places[name]
        values = np.empty((len(self), *shape))
        self._core.read(offset, values.reshape(len(self), -1))
        return values

    def reset_warm_start(self, simulations=None):
        """Drops the start of the next solve, of a list of simulations, or of all: for those that start over."""
        self._core.reset_warm_start(numbers_of(simulations, len(self)))

    def reset(self, simulations=None):
        """mujoco.mj_resetData and reset_warm_start, of a list of simulations or of all."""
        chosen = numbers_of(simulations, len(self))
        for i in chosen:
            mujoco.mj_resetData(self.model, self.data[i])
        self.reset_warm_start(chosen)

    def set_accuracy(self, tolerance=None, max_iterations=None):
        """Tolerances and iteration limits of the solves to come: a number, one per simulation, or None: the solver's.
        Raises TypeError or ValueError for negative or fractional ones, for NaN, and for another count.
        """
        def spread(name, value, check):
            return [] if value is None else spread_over(name, check(name, value), len(self)).tolist()

        self._limits = (spread("tolerance", tolerance, each_not_negative),
                        spread("max_iterations", max_iterations, each_count))
        self._core.limit(*self._limits)

    # -- what the last solve did --------------------------------------------------------------------------------------

    @property
    def status(self):
        """Records of the last solve, one per simulation, as stiction.Solution.status; a copy."""
        return np.frombuffer(bytearray(self._core.status()), STATUS_DTYPE)

    def batch(self):
        """The constraints of the last solve as a stiction.Batch in Jacobian form; copies. `extras` has lambda_, the
        reactions, velocities, the accelerations, and cone_id. With solver="mujoco" they are those that lie in `data`."""
        if not self._uses_mujoco:
            return batch_of(_core.mujoco_arrays(self._core), self.model.nv)
        self._collect()
        batch = batch_of(_core.mujoco_arrays(self._core), self.model.nv)
        take_answers(batch, self.data, self.model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4)
        return batch

    def pull(self, accelerations, forces=None, **options):
        """Pulls derivatives of a loss by the accelerations of the last solve back to that solve's input. It is that of
        the state before a step, or of forward(). Positions are frozen.

        accelerations: by qacc, (n, nv). forces: by efc_force, a list of arrays, one per simulation; None: zeros.
        options: residual_limit, tie_tolerance, max_unknowns, threads of stiction.Derivative.

        Returns a stiction.Gradients, whose `status` and `valid` say which simulations have a derivative:
        qfrc (n, nv): by generalized forces, as qfrc_applied and actuators have them.
        qvel (n, nv): by velocities as far as aref depends on them. The dependence of forces without contact on
            velocities is not in it: multiply your knowledge of that by qfrc.
        qacc_smooth (n, nv), M (n, nv, nv); aref, R, J, friction: lists of arrays, one per simulation, by row. The friction
            of a pyramid is part of its J, and has 0 here.
        """
        return pull(self, accelerations, forces, **options)

    def clear(self):
        """Sets the seconds to zero."""
        self.seconds = dict.fromkeys(("smooth", "assemble", "solve", "advance"), 0.0)

    # -- the stages ---------------------------------------------------------------------------------------------------

    def _activate(self, active):
        refuse(self.model)
        self._core.configure(float(self.model.opt.timestep), bool(mujoco.mj_isSparse(self.model)))
        if active is None:
            if self._active is not None:
                self._core.activate([1] * len(self))
                self._active = None
            return
        chosen = np.asarray(active, bool)
        if chosen.shape != (len(self),):
            raise ValueError(f"active: expected bool ({len(self)},), got {chosen.shape}")
        self._active = chosen
        self._core.activate(chosen.astype(np.uint8).tolist())

    def _write_ctrl(self, ctrl):
        ctrl = np.asarray(ctrl, float)
        if ctrl.shape != (len(self), self.model.nu):
            raise ValueError(f"ctrl: expected ({len(self)}, {self.model.nu}), got {ctrl.shape}")
        self._core.write_controls(np.ascontiguousarray(ctrl))

    def _stages_at(self, names):
        for name in names:
            if name not in self._stages:
                self._stages[name] = address(name)
        return [self._stages[name] for name in names]

    def _run(self, *stages):
        """Takes every simulation through functions of MuJoCo's and stages of our own, all of them one after the other."""
        self._core.run(self._stages_at(stages))

    def _stages_before_solve(self, check, senses=True):
        """The functions of MuJoCo up to the solve, of one stage of a step. RK4 has sensors in the first alone, and energies
        in all: after a step data.energy is that of the last, as mj_step leaves it."""
        energy = bool(self.model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_ENERGY)
        return (*(("mj_checkPos", "mj_checkVel") if check else ()), "mj_fwdPosition",
                *(("mj_sensorPos",) if senses else ()), *(("mj_energyPos",) if energy else ()), "mj_fwdVelocity",
                *(("mj_sensorVel",) if senses else ()), *(("mj_energyVel",) if energy else ()), "mj_fwdActuation",
                "mj_fwdAcceleration")

    def _stages_after_solve(self):
        """The functions of MuJoCo between the first solve of a step and its integrator."""
        compares = bool(self.model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_FWDINV)
        return (*self._sensor_stages, "mj_checkAcc", *(("mj_compareFwdInv",) if compares else ()))

    def _step_stages(self):
        """The solves of a step, and the simulations' stages before and after each."""
        integrator = self.model.opt.integrator
        if integrator == mujoco.mjtIntegrator.mjINT_RK4:
            smooth = (self._stages_before_solve(check=True), *[self._stages_before_solve(check=False, senses=False)] * 3)
            on = ((*self._stages_after_solve(), "rk4_begin", "rk4_enter_1"), ("rk4_leave_1", "rk4_enter_2"),
                  ("rk4_leave_2", "rk4_enter_3"), ("rk4_leave_3", "rk4_end"))
            return tuple(zip(smooth, on))
        name = "mj_Euler" if integrator == mujoco.mjtIntegrator.mjINT_EULER else "mj_implicit"
        return ((self._stages_before_solve(check=True), (*self._stages_after_solve(), name)),)

    def _run_solves(self, key, stages, count=1):
        """Runs `count` times the solves of a step. stages() gives the functions that every simulation runs before and after
        each solve. They are kept by `key`: in a cache that MuJoCo has filled, every line of Python counts."""
        plan = self._plans.get(key)
        if plan is None:
            own_stage = address("mj_fwdConstraint") if self._uses_mujoco else 0
            plan = self._plans[key] = [
                _core.MujocoSolve(self._stages_at(before), self._stages_at(after), own_stage) if own_stage else
                _core.MujocoSolve(self._stages_at((*before, "count")), self._stages_at(("write_back", *after)), own_stage)
                for before, after in stages()]
        if self._uses_mujoco or self.solver._statistics.only_keeps:
            return self._run_plan(plan, count)
        for _ in range(count):  # a callback is called after every solve
            for solve in plan:
                self._run_plan([solve], 1)

    def _run_plan(self, plan, count):
        """Runs a list of solves `count` times, and adds up where the seconds went."""
        found = self._core.step(plan, count)
        for name, seconds in zip(self.seconds, found):
            self.seconds[name] += seconds
        if not self._uses_mujoco:
            self._record_statistics(found[2], count * len(plan))

    def _collect(self):
        """Gathers the constraints that MuJoCo's own solver has solved."""
        self._activate(None)
        self._run("count")
        self._core.gather(all=True)
        if self.model.opt.integrator == _DISCRETE:
            Metric(self.model).before(self._core, self.data)

    def _constrain_discretely(self, check):
        """Up to accelerations with integrator `discrete`, parts of whose metric mj_forward alone builds: it runs, with a
        solver whose line search makes no step."""
        start = time.perf_counter()
        with other_options(self.model, ls_iterations=None if self._uses_mujoco else 0):
            self._run(*(("mj_checkPos", "mj_checkVel") if check else ()), "mj_forward")
        found = time.perf_counter()
        self.seconds["smooth"] += found - start
        if self._uses_mujoco:
            return
        self._run("count")
        self._core.gather(all=True)  # their metrics take the places of masses
        self._metric = self._metric or Metric(self.model)
        self._metric.before(self._core, [one for i, one in enumerate(self.data)
                                         if self._active is None or self._active[i]])
        gathered = time.perf_counter()
        self._core.solve()
        solved = time.perf_counter()
        self._run("write_back")
        self._metric.after()
        self.seconds["assemble"] += gathered - found + time.perf_counter() - solved
        self.seconds["solve"] += solved - gathered
        self._record_statistics(solved - gathered, 1)

    def _record_statistics(self, seconds, solves):
        """Statistics, callback and files of failures of the solver, as of its own solves."""
        statistics, guess = self.solver._statistics, self._warm or None
        records = self._core.take_records()
        if statistics.only_keeps:
            statistics.keep(len(self), seconds, guess is not None, records, solves)
            return
        if statistics._folder is None or (self.status["code"] == SOLVED).all():
            statistics.note(self, self, guess, seconds, False)
            return
        batch = self.batch()
        answer = {"lambda_": batch.extras["lambda_"], "velocities": batch.extras["velocities"], "status": self.status}
        statistics.note(batch, Solution.over(batch, answer), None, seconds, False)

    #: Statistics read this of solved batches.
    form = "mujoco"
