"""MJX's constraint solvers (Newton, CG) on padded batches, by way of the slide-joint models of mujoco_rows.py.

MJX's own pipeline gives every environment the same rows, with J = 0 where a contact is open, as padded.Padded has. J,
M, free acceleration, target, compliance, friction and friction loss are written into its Data; solver.solve, under jit
and vmap, is MJX's. f64 is JAX's x64 mode.
"""

import os

os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")  # other programs have arrays on the same GPU

import jax  # noqa: E402
import mujoco  # noqa: E402
import mujoco_rows  # noqa: E402
import numpy as np  # noqa: E402
from environments import BOX, FREE, UNILATERAL  # noqa: E402
from jax import numpy as jnp  # noqa: E402
from mujoco import mjx  # noqa: E402
from mujoco.mjx._src import solver  # noqa: E402

SOLVERS = {"Newton": mujoco.mjtSolver.mjSOL_NEWTON, "CG": mujoco.mjtSolver.mjSOL_CG}
CONTACT_SIZES = (3, 4, 6)


class Peer:
    """One solver on `envs` environments in one precision."""

    def __init__(self, padded, envs, precision, method, device):
        self.wide = precision == "f64"
        self.device = jax.devices("gpu" if device.startswith("cuda") else "cpu")[0]
        contacts = padded.contacts()
        if any(size not in CONTACT_SIZES for _, size in contacts):
            raise ValueError("MJX has contacts of 1, 3, 4 and 6 rows")
        of_kind = {kind: sum(size * cones for own, size, cones, _ in padded.segments if own == kind) for kind in (FREE, BOX, UNILATERAL)}
        address, size = (np.array([contact[k] for contact in contacts], int) for k in (0, 1))
        model = mujoco_rows.model_of(list(padded.M), 0, padded.rows)
        model.opt.solver, model.opt.impratio = SOLVERS[method], padded.impratio()
        model.opt.iterations = mujoco_rows.ITERATIONS[method]
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
        model.dof_frictionloss[:] = of_kind[BOX] > 0
        with jax.enable_x64(self.wide), jax.default_device(self.device):
            self.model = mjx.put_model(model)
            blank = mjx.make_data(self.model)
            some = dict(J=padded.J, D=1 / padded.R, target=padded.target, loss=padded.bound, friction=padded.contact_friction(),
                        M=padded.M, free=padded.v_free, smooth=np.einsum("eij,ej->ei", padded.M, padded.v_free),
                        factor=np.linalg.cholesky(padded.M).transpose(0, 2, 1))
            copies, kind = -(-envs // len(padded.R)), jnp.float64 if self.wide else jnp.float32
            self.arrays = {name: jnp.asarray(np.tile(value, (copies,) + (1,) * (value.ndim - 1))[:envs], kind)
                           for name, value in some.items()}
            blank_contact = blank._impl.contact
            kept = dict(ne=of_kind[FREE], nf=of_kind[BOX], nl=of_kind[UNILATERAL], nefc=padded.rows, ncon=len(contacts))

            def one(tolerance, own):
                impl = blank._impl.replace(
                    **kept, M=own["M"], qLD=own["factor"], efc_J=own["J"], efc_D=own["D"], efc_aref=own["target"],
                    efc_frictionloss=own["loss"], efc_force=jnp.zeros_like(own["D"]),
                    contact=blank_contact.replace(dim=size, efc_address=address, friction=own["friction"]))
                data = blank.replace(qacc_smooth=own["free"], qacc_warmstart=own["free"], qacc=own["free"], qfrc_smooth=own["smooth"],
                                     qfrc_constraint=jnp.zeros_like(own["free"]), _impl=impl)
                wanted = self.model.tree_replace({"opt.tolerance": tolerance})
                return solver.solve(wanted, data)._impl.efc_force

            self.compiled = jax.jit(jax.vmap(one, in_axes=(None, 0)))

    def solve(self, tolerance):
        """Reactions (environments, rows), complete on return."""
        with jax.enable_x64(self.wide), jax.default_device(self.device):
            return self.compiled(jnp.asarray(tolerance, jnp.float64 if self.wide else jnp.float32), self.arrays).block_until_ready()
