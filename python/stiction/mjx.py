"""MJX with stiction as its constraint solver: a JAX function that can be jitted, vmapped and differentiated.

    data, status = stiction.mjx.step(model, data)           # mujoco.mjx.step with this solver
    data, status = jax.jit(jax.vmap(stiction.mjx.step, (None, 0)))(model, data)     # of many worlds
    stiction.jax.status(status)["residual"]

MJX has room for all contacts that a model can have. Contacts that do not touch are rows of zeros here, as they are
there. docs/howto/mujoco_warp.md.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco.mjx._src import collision_driver, constraint, support
from mujoco.mjx._src import solver as _theirs

from . import jax as stiction_jax
from .core.arrays import STATUS_DTYPE
from .core.replaced import replaced
from .core.solution import CODES, SOLVED

__all__ = ["solve", "step"]

_KINDS = mujoco.mjtConstraint
_NUMERICAL = CODES.index("numerical")
_BOXES = int(_KINDS.mjCNSTR_FRICTION_DOF), int(_KINDS.mjCNSTR_FRICTION_TENDON)


def solve(model, data, *, solver="auto", tolerance=1e-5, max_iterations=1000):
    """As mjx's solver: from the rows and qacc_smooth to qacc, qfrc_constraint and efc_force.

    model, data: of mjx.put_model and put_data with MJX's own implementation, impl="jax". solver, tolerance,
    max_iterations: as of stiction.jax.solve, which has J M^-1 J' for A. Returns data, and the status as uint8 (32,),
    which stiction.jax.status names. A solve starts from no force. Raises TypeError for another implementation.
    """
    efc = data._impl
    if not hasattr(efc, "efc_type"):
        raise TypeError(f"data: expected mjx data of impl='jax', got {type(efc).__name__}: with impl='warp' use "
                        "stiction.mujoco_warp on MuJoCo Warp's own data")
    dims = collision_driver.make_condim(model)
    kinds = constraint.make_efc_type(model, dims)
    if not len(kinds) or not model.nv:
        data = _theirs.solve(model, data)
        return data, _judged(jnp.zeros(STATUS_DTYPE.itemsize, jnp.uint8), data.qacc)
    cones, places = _cones(kinds, dims, constraint.make_efc_address(model, dims, kinds))
    mu = jnp.zeros(len(kinds), efc.efc_D.dtype)
    for contact, row, dim in places:
        mu = mu.at[row + 1:row + dim].set(efc.contact.friction[contact, :dim - 1])
    J, D = efc.efc_J, efc.efc_D
    push = jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(support.full_m(model, data)), J.T)
    A = J @ push
    A = 0.5 * (A + A.T)
    b = J @ data.qacc_smooth - efc.efc_aref
    loss = jnp.where(np.isin(kinds, _BOXES), efc.efc_frictionloss, 0.0)
    force, _, status = stiction_jax.solve(A, b, mu, 1 / D, -loss, loss, cones=cones, law="convex", solver=solver,
                                          tolerance=tolerance, max_iterations=max_iterations)
    data = data.tree_replace({"qacc": data.qacc_smooth + push @ force, "qfrc_constraint": J.T @ force,
                              "_impl.efc_force": force})
    return data, _judged(status, data.qacc)


def step(model, data, **options):
    """As mjx.step. Returns data and the status of the step's last solve. options: of `solve`."""
    statuses = []

    def solve_and_keep(model, data):
        data, status = solve(model, data, **options)
        statuses.append(status)
        return data

    with replaced(_theirs, "solve", solve_and_keep):
        data = mjx.step(model, data)
    return data, statuses[-1]


def _judged(status, qacc):
    """The status of a world, which is not `solved` where its accelerations are no numbers."""
    code = STATUS_DTYPE.fields["code"][1]
    is_bad = ~jnp.all(jnp.isfinite(qacc)) & (status[code] == SOLVED)
    return status.at[code].set(jnp.where(is_bad, _NUMERICAL, status[code]).astype(jnp.uint8))


def _cones(kinds, dims, addresses):
    """Cones of all rows, and (contact, first row, rows) of those that are elliptic. Both are static."""
    contact_at = {int(row): contact for contact, row in enumerate(addresses)}
    cones, places, row = [], [], 0
    while row < len(kinds):
        if kinds[row] == int(_KINDS.mjCNSTR_CONTACT_ELLIPTIC):
            contact = contact_at[row]
            places.append((contact, row, int(dims[contact])))
            cones.append(("friction", int(dims[contact])))
            row += int(dims[contact])
            continue
        equality = kinds[row] == int(_KINDS.mjCNSTR_EQUALITY)
        cones.append("free" if equality else "box" if kinds[row] in _BOXES else "unilateral")
        row += 1
    return tuple(cones), places
