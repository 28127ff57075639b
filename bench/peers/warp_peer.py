"""MuJoCo Warp's constraint solvers (Newton, CG; f32) on padded batches, by way of the slide-joint models of mujoco_rows.py.

The results of its pipeline are written into its Data before solve(). They are J (dense), M, free acceleration, target,
compliance, friction, friction loss, and for each contact of each world its rows. On a GPU a solve is captured once and
launched as a graph, as its documentation advises.
"""

import mujoco
import mujoco_rows
import mujoco_warp
import numpy as np
import warp
from environments import BOX, FREE, FRICTION, UNILATERAL
from mujoco_warp._src import types

SOLVERS = {"Newton": mujoco.mjtSolver.mjSOL_NEWTON, "CG": mujoco.mjtSolver.mjSOL_CG}
ROW_TYPE = {FREE: types.ConstraintType.EQUALITY, BOX: types.ConstraintType.FRICTION_TENDON,
            UNILATERAL: types.ConstraintType.LIMIT_TENDON, FRICTION: types.ConstraintType.CONTACT_ELLIPTIC}


class Peer:
    """One solver on `envs` environments."""

    def __init__(self, padded, envs, method, device):
        warp.config.quiet = True
        self.device, self.on_gpu = device, device.startswith("cuda")
        contacts = padded.contacts()
        model = mujoco_rows.model_of(list(padded.M), 0, padded.rows, max((size for _, size in contacts), default=1))
        model.opt.solver, model.opt.impratio = SOLVERS[method], padded.impratio()
        model.opt.iterations = mujoco_rows.ITERATIONS[method]
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_WARMSTART
        with warp.ScopedDevice(device):
            self.model = mujoco_warp.put_model(model)
            self.data = mujoco_warp.make_data(model, nworld=envs, nconmax=max(len(contacts), 1), njmax=padded.rows)
            self.fill(model, padded, contacts, envs)
            mujoco_warp.factor_m(self.model, self.data)
            self.graph = self.capture() if self.on_gpu else None

    def fill(self, model, padded, contacts, envs):
        data, copies = self.data, -(-envs // len(padded.R))

        def every(array):
            return np.tile(array, (copies,) + (1,) * (array.ndim - 1))[:envs]

        def put(target, value):
            whole = target.numpy()
            whole[tuple(slice(0, n) for n in np.shape(value))] = value
            target.assign(whole)

        rows = np.repeat(np.arange(model.nv), model.M_rownnz)
        put(data.M, every(padded.M)[:, rows, model.M_colind])
        put(data.qacc_smooth, every(padded.v_free))
        put(data.qacc_warmstart, every(padded.v_free))
        put(data.qfrc_smooth, every(np.einsum("eij,ej->ei", padded.M, padded.v_free)))
        put(data.efc.J, every(padded.J))
        put(data.efc.D, every(1 / padded.R))
        put(data.efc.aref, every(padded.target))
        put(data.efc.frictionloss, every(padded.bound))
        kinds = np.concatenate([np.full(size * cones, kind) for kind, size, cones, _ in padded.segments])
        ids = np.tile(np.arange(padded.rows), (envs, 1))
        for k, (first, size) in enumerate(contacts):
            ids[:, first:first + size] = (np.arange(envs) * len(contacts) + k)[:, None]
        put(data.efc.type, np.tile([int(ROW_TYPE[kind]) for kind in kinds], (envs, 1)))
        put(data.efc.id, ids)
        for target, kind in ((data.ne, FREE), (data.nf, BOX), (data.nl, UNILATERAL)):
            target.fill_(int((kinds == kind).sum()))
        data.nefc.fill_(padded.rows)
        data.nacon.fill_(envs * len(contacts))
        if contacts:
            address = np.full((len(contacts), data.contact.efc_address.shape[1]), -1)
            for k, (first, size) in enumerate(contacts):
                address[k, :size] = np.arange(first, first + size)
            put(data.contact.dim, np.tile([size for _, size in contacts], envs))
            put(data.contact.efc_address, np.tile(address, (envs, 1)))
            put(data.contact.friction, every(padded.contact_friction()).reshape(-1, 5))
            put(data.contact.worldid, np.repeat(np.arange(envs), len(contacts)))
            data.contact.dist.fill_(-1.0)
            data.contact.includemargin.fill_(0.0)
            data.contact.type.fill_(int(types.ContactType.CONSTRAINT))

    def capture(self):
        mujoco_warp.solve(self.model, self.data)  # compiles
        with warp.ScopedCapture() as captured:
            mujoco_warp.solve(self.model, self.data)
        return captured.graph

    def solve(self, tolerance):
        """Reactions (environments, rows), queued on PyTorch's stream on a GPU."""
        with warp.ScopedDevice(self.device):
            if self.graph is None:
                self.model.opt.tolerance.fill_(tolerance)
                mujoco_warp.solve(self.model, self.data)
            else:
                with warp.ScopedStream(warp.stream_from_torch()):
                    self.model.opt.tolerance.fill_(tolerance)
                    warp.capture_launch(self.graph)
            return self.data.efc.force
