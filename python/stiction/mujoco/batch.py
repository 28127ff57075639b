"""Batch that a BatchedSimulation has solved, and a BatchedSimulation made again."""

import mujoco
import numpy as np

from .. import _core
from ..core.batch import Batch
from ..core.solver import Solver
from .data import check_data, refuse
from .memory_layout import address, handlers, layout


def gather(model, data, **options):
    """The constraints of many mujoco.MjData of one model, as they lie there after mj_forward or mj_fwdAcceleration, as
    one stiction.Batch in Jacobian form: accelerations and forces. options: of BatchedSimulation."""
    places = list(data)
    if not places:
        raise ValueError("data: expected at least one mujoco.MjData, got none")
    for i, one in enumerate(places):
        check_data(model, i, one)
    refuse(model)
    core = _core.MujocoSimulations(layout(model, places[0]), address("mj_mulJacTVec"), address("mj_integratePos"),
                                   handlers(), model._address, [one._address for one in places],
                                   Solver(**options)._options, 0.0)
    core.run([_core.mujoco_stages()["count"]])
    core.gather(all=True)
    return batch_of(_core.mujoco_arrays(core), model.nv)


def batch_of(arrays, nv):
    """A copy of the arrays of the C++ side. With M as a factor their degrees of freedom run backwards: in MuJoCo's order."""
    factored = arrays.pop("factored")
    arrays = {name: array.copy() for name, array in arrays.items()}
    if factored:
        for name in ("J", "v_free", "velocities"):
            arrays[name] = np.ascontiguousarray(arrays[name].reshape(-1, nv)[:, ::-1]).reshape(-1)
        factor = arrays["M"].reshape(-1, nv, nv)
        arrays["M"] = np.ascontiguousarray((factor @ factor.transpose(0, 2, 1))[:, ::-1, ::-1]).reshape(-1)
    else:  # its lower triangles alone were written
        lower = np.tril(arrays["M"].reshape(-1, nv, nv))
        arrays["M"] = (lower + np.tril(lower, -1).transpose(0, 2, 1)).reshape(-1)
    dims = np.diff(arrays["cone_row_offsets"])
    batch = Batch.from_jacobian(
        arrays["J"], arrays["M"], arrays["v_free"], arrays["target"], kinds=arrays["kinds"], dims=dims,
        offsets=arrays["offsets"], dof_offsets=arrays["dof_offsets"], mass_block=0, mu=arrays["mu"], R=arrays["R"],
        lo=arrays["lo"], hi=arrays["hi"], law="convex")
    batch.extras = {"cone_id": arrays["ids"], "lambda_": arrays["lambda_"], "velocities": arrays["velocities"]}
    return batch


def take_answers(batch, data, is_rk4):
    """Gives the batch MuJoCo's own answers. After a step of RK4 qacc is no solve's, and accelerations follow from forces."""
    batch.extras.update(lambda_=np.concatenate([one.efc_force[:one.nefc] for one in data]),
                        velocities=np.concatenate([one.qacc for one in data]))
    if not is_rk4:
        return
    nv, begin = len(batch.v_free) // len(data), 0
    for i, one in enumerate(data):
        J = batch.J[begin:begin + one.nefc * nv].reshape(-1, nv)
        begin += J.size
        own = slice(i * nv, (i + 1) * nv)
        M = batch.M.reshape(-1, nv, nv)[i]
        batch.extras["velocities"][own] = batch.v_free[own] + np.linalg.solve(M, J.T @ one.efc_force[:one.nefc])


def remade(cls, model, data, made_by, limits, held):
    """A simulation with that model, copies of those data, and another one's other state."""
    made = cls(model, len(data), **made_by)
    for mine, one in zip(made.data, data):
        mujoco.mj_copyData(mine, model, one)
    if limits is not None:
        made._limits = limits
        made._core.limit(*limits)
    made._held = held
    return made
