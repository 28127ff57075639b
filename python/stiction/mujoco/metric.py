"""The metric in which MuJoCo's integrator `discrete` solves constraints: M + h D + h^2 K in place of M."""

import ctypes

import mujoco
import numpy as np

from .memory_layout import LayoutError, library

_HINGE = """<mujoco><option integrator="discrete" timestep="0.01"/><worldbody><body><joint axis="0 1 0" damping="0.5"
stiffness="2"/><geom size=".1" pos=".3 0 0"/></body></worldbody></mujoco>"""
_known = {}


def _functions():
    """MuJoCo's functions of the metric, which its library has and its header does not; tried on a hinge, once."""
    if not _known:
        where = library()
        try:
            add, possible = where.mj_effMulAdd, where.mjd_freeGyroPossible
        except AttributeError:
            raise LayoutError(f"MuJoCo {mujoco.__version__} has no mj_effMulAdd, by which the metric of integrator "
                              "discrete is read: set mjINT_IMPLICITFAST, or use a version that the package's tests "
                              "pass with (4.0.0)") from None
        add.argtypes, add.restype = 4 * [ctypes.c_void_p] + [ctypes.c_int], None
        possible.argtypes, possible.restype = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int], ctypes.c_int
        model = mujoco.MjModel.from_xml_string(_HINGE)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        found = effective_mass(model, data, add)[0, 0] - data.M[0]
        if not abs(found - (0.01 * 0.5 + 0.01 ** 2 * 2)) < 1e-12:
            raise LayoutError(f"mj_effMulAdd of MuJoCo {mujoco.__version__} is not what it was in 4.0.0: set "
                              "mjINT_IMPLICITFAST")
        _known.update(add=add, possible=possible)
    return _known["add"], _known["possible"]


def effective_mass(model, data, add=None):
    """The metric of that data after mj_fwdPosition, (nv, nv)."""
    add = add or _functions()[0]
    nv = model.nv
    mass = np.zeros((nv, nv))
    mujoco.mj_fullM(model, data, mass)
    units = np.eye(nv)
    row, unit, m, d = mass.ctypes.data, units.ctypes.data, model._address, data._address
    for offset in range(0, mass.nbytes, nv * mass.itemsize):  # symmetric: a row is a column
        add(m, d, row + offset, unit + offset, 1)
    return mass


class Metric:
    """Work of `discrete` around a solve of many simulations of a model."""

    def __init__(self, model):
        self._model = model
        _functions()
        self._free = [(j, int(model.jnt_dofadr[j])) for j in np.flatnonzero(
            np.asarray(model.jnt_type) == int(mujoco.mjtJoint.mjJNT_FREE))]
        self._kept = []

    def before(self, core, data):
        """Gives the gathered batch the metrics of these simulations for their mass matrices. Keeps MuJoCo's
        accelerations of free bodies that nothing touches: they are implicit in the spin, and no constraint's
        concern."""
        model, possible = self._model, _functions()[1]
        self._kept = [(one, first, one.qacc[first:first + 6].copy()) for one in data for joint, first in self._free
                      if possible(model._address, one._address, joint)]
        masses = np.empty((len(data), model.nv, model.nv))
        for i, one in enumerate(data):
            masses[i] = effective_mass(model, one)
        if core.has_factors():  # of degrees of freedom from the last to the first
            masses = np.linalg.cholesky(np.ascontiguousarray(masses[:, ::-1, ::-1]))
        core.set_masses(np.ascontiguousarray(masses))

    def after(self):
        """Puts those accelerations back."""
        for one, first, acceleration in self._kept:
            one.qacc[first:first + 6] = acceleration
