"""Derivatives of the accelerations that a BatchedSimulation has computed. They go by MuJoCo's own J, M, aref and R of the last
solve: positions, and with them the contacts' geometry, are frozen (docs/howto/mujoco.md)."""

import numpy as np

from ..core.derivative import Derivative, Gradients


def pull(simulation, accelerations, forces, **options) -> Gradients:
    """As BatchedSimulation.pull."""
    n, nv = len(simulation), simulation.model.nv
    if simulation._active is not None and not simulation._active.all():
        raise ValueError("active: expected a last solve of all simulations, got one of some: call forward()")
    batch = simulation.batch()
    accelerations = np.asarray(accelerations, float)
    if accelerations.shape != (n, nv):
        raise ValueError(f"accelerations: expected ({n}, {nv}), got {accelerations.shape}")
    ends = np.cumsum([one.nefc for one in simulation.data])
    if forces is not None:
        forces = np.concatenate([np.asarray(one, float).ravel() for one in forces])
        if forces.shape != (batch.rows,):
            raise ValueError(f"forces: expected one per row of efc_force, {batch.rows} of all simulations, got {forces.size}")
    found = Derivative(law="convex", **options).vjp(batch, batch.extras["lambda_"], velocities=accelerations.ravel(),
                                                    lambda_=forces, status=simulation.status)
    by_free = found.v_free.reshape(n, nv)
    mass = batch.M.reshape(n, nv, nv)
    qfrc = np.linalg.solve(mass, by_free[..., None])[..., 0] if nv else by_free
    target, mu, R = (np.split(getattr(found, name), ends[:-1]) for name in ("target", "mu", "R"))
    rows = batch.J.reshape(-1, nv)
    damping = np.concatenate([one.efc_KBIP[:, 1] for one in simulation.data])
    pushed = np.split(-(damping * found.target)[:, None] * rows, ends[:-1])
    qvel = np.stack([part.sum(0) for part in pushed]) if n else np.zeros((0, nv))
    return Gradients(qfrc=qfrc, qvel=qvel, qacc_smooth=by_free, aref=target, friction=mu, R=R,
                     J=np.split(found.J.reshape(-1, nv), ends[:-1]), M=found.M.reshape(n, nv, nv), status=found.status)
