"""The mujoco.MjData of a BatchedSimulation, and the models that it does not step."""

import collections.abc
import contextlib

import mujoco
import numpy as np

from ..core.arguments import whole

_CALLBACKS = [(name, getattr(mujoco, f"get_mjcb_{name}")) for name in (
    "passive", "control", "contactfilter", "sensor", "act_dyn", "act_gain", "act_bias") if hasattr(mujoco, f"get_mjcb_{name}")]
_IPC, _SLEEP = (getattr(mujoco.mjtEnableBit, name, 0) for name in ("mjENBL_IPC", "mjENBL_SLEEP"))
_RK4 = mujoco.mjtIntegrator.mjINT_RK4


def check_data(model, i, one):
    """Raises TypeError or ValueError for objects that are no mjData of that model."""
    if not isinstance(one, mujoco.MjData):
        raise TypeError(f"data[{i}]: expected a mujoco.MjData, got {type(one).__name__}")
    if one.model._address != model._address:
        raise ValueError(f"data[{i}]: expected data of this simulation's model, got data of another one: make it with "
                         "mujoco.MjData(simulation.model)")


def count_of(nstep):
    """Returns the number of steps. Raises TypeError or ValueError for a wrong number of steps."""
    nstep = whole("nstep", nstep)
    if nstep < 0:
        raise ValueError(f"nstep: expected a number of steps of at least 0, got {nstep}")
    return nstep


@contextlib.contextmanager
def other_options(model, ls_iterations=None, disable=0):
    """Other options of a model within its scope."""
    opt = model.opt
    kept = opt.ls_iterations, opt.disableflags
    try:
        opt.ls_iterations = kept[0] if ls_iterations is None else ls_iterations
        opt.disableflags |= int(disable)
        yield
    finally:
        opt.ls_iterations, opt.disableflags = kept


def numbers_of(simulations, count):
    """List of those simulations, of so many; None: all. Raises TypeError or ValueError for other arguments."""
    if simulations is None:
        return list(range(count))
    if getattr(simulations, "dtype", None) == bool:
        raise TypeError("simulations: expected their numbers, got a mask: numpy.flatnonzero(mask) has them")
    chosen = [whole("simulations", i) for i in simulations]
    for i in chosen:
        if not 0 <= i < count:
            raise ValueError(f"simulations: expected numbers in 0..{count - 1}, got {i}")
    return chosen


class Simulations(collections.abc.Sequence):
    """The mujoco.MjData of a BatchedSimulation. One may be replaced by another of the same model, `data[i] = other`;
    its constraints' warm start is dropped then. Raises TypeError or ValueError for anything else."""

    def __init__(self, model, data):
        self._model, self._data, self._core = model, [], None
        self._places = {}  # address -> simulation
        for i, one in enumerate(data):
            self._data.append(self._checked(i, one))
            self._places[one._address] = i

    def __len__(self):
        return len(self._data)

    def __getitem__(self, i):
        return self._data[i]

    def __repr__(self):
        return repr(self._data)

    def __setitem__(self, i, one):
        if not isinstance(i, (int, np.integer)):
            raise TypeError(f"data: expected one simulation at a time, data[i] = ..., got {i!r}")
        if not -len(self) <= i < len(self):
            raise IndexError(f"data: expected a simulation in 0..{len(self) - 1}, got {i}")
        i = int(i) % len(self)
        if one is self._data[i]:
            return
        one = self._checked(i, one)
        self._core.replace(i, one._address)
        del self._places[self._data[i]._address]
        self._data[i], self._places[one._address] = one, i

    def _checked(self, i, one):
        check_data(self._model, i, one)
        if one._address in self._places:
            raise ValueError(f"data[{i}]: expected data of its own, got that of simulation {self._places[one._address]}: "
                             "two threads would write to it")
        return one


def refuse(model):
    """Raises ValueError for models that would be stepped otherwise than by MuJoCo."""
    opt = model.opt
    flags, is_rk4 = opt.enableflags, opt.integrator == _RK4
    if flags & _IPC:
        raise ValueError("model.opt.enableflags: expected no mjENBL_IPC, got it, whose barriers are no constraint rows: "
                         "clear it")
    if is_rk4 and flags & _SLEEP:
        raise ValueError("model.opt.enableflags: expected no sleeping bodies with RK4, got mjENBL_SLEEP: set "
                         "model.opt.integrator to mjINT_IMPLICITFAST")
    if opt.noslip_iterations:
        raise ValueError(f"model.opt.noslip_iterations: expected 0, got {opt.noslip_iterations}: that step leaves the "
                         "solution; a tighter tolerance does not need it")
    for name, callback in _CALLBACKS:
        if callback() is not None:
            raise ValueError(f"mjcb_{name}: expected no callback, got one, which simulations on several threads cannot "
                             f"call: mujoco.set_mjcb_{name}(None)")
    if is_rk4:
        for name, why in (("na", "actuator states"), ("nplugin", "plugins"), ("nhistory", "delays"),
                          ("nplastic", "plasticity")):
            if getattr(model, name, 0):
                raise ValueError(f"model.{name}: expected 0 with RK4, got {getattr(model, name)} ({why}): set "
                                 "model.opt.integrator to mjINT_IMPLICITFAST")
