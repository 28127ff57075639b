"""Drawing of a stiction.mujoco.BatchedSimulation."""

import mujoco
import numpy as np

from ..core.arrays import STATUS_DTYPE
from .frame import Contacts, Frame, Geometry, islands

_SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3, "plane": 0, "mesh": 0}
_KINDS = {int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind.upper()}")): kind for kind in _SIZES}
_SHOWN_GROUPS = 3  # MuJoCo's viewer shows geoms of groups 0 to 2


def _name(model, kind, i, word):
    return mujoco.mj_id2name(model, kind, i) or f"{word}_{i}"


class MujocoSource:
    """Bodies, contacts and residuals of all simulations as their last step left them. Geoms are where MuJoCo found the
    contacts, at the beginning of that step. Height fields, skins and flexible bodies are not drawn.
    """

    def __init__(self, simulation):
        model = simulation.model
        self._simulation, self._model = simulation, model
        self._scratch = mujoco.MjData(model)
        self.env_count, self.dt = len(simulation), model.opt.timestep
        self.up = -np.array(model.opt.gravity)
        self.weight = float(model.body_mass.sum() * np.linalg.norm(model.opt.gravity))
        self.bodies = [_name(model, mujoco.mjtObj.mjOBJ_BODY, i, "body") for i in range(1, model.nbody)]
        self.geometries = [self._geometry(i) for i in range(model.ngeom) if self._is_shown(i)]
        rounds = model.geom_rbound[model.geom_bodyid > 0]
        self.reach = float(rounds.max()) if len(rounds) else 0.0

    def _is_shown(self, i):
        model = self._model
        return int(model.geom_type[i]) in _KINDS and model.geom_group[i] < _SHOWN_GROUPS and model.geom_rgba[i, 3] > 0

    def _geometry(self, i):
        model = self._model
        kind = _KINDS[int(model.geom_type[i])]
        size = self._mesh(model.geom_dataid[i]) if kind == "mesh" else tuple(model.geom_size[i, :_SIZES[kind]])
        return Geometry(_name(model, mujoco.mjtObj.mjOBJ_GEOM, i, "geom"), kind, size, int(model.geom_bodyid[i]) - 1,
                        tuple(model.geom_pos[i]), tuple(model.geom_quat[i]))

    def _mesh(self, i):
        model = self._model
        vertices, faces = ((first[i], first[i] + count[i]) for first, count in (
            (model.mesh_vertadr, model.mesh_vertnum), (model.mesh_faceadr, model.mesh_facenum)))
        return model.mesh_vert[slice(*vertices)].copy(), model.mesh_face[slice(*faces)].copy()

    def look(self):
        """Copies the source of the frames of this time."""
        status = self._simulation.status
        self.status = status if len(status) else np.zeros(self.env_count, STATUS_DTYPE)  # none before the first solve

    def frame(self, env) -> Frame:
        """One simulation, after look()."""
        model, data = self._model, self._simulation.data[env]
        if not data.xquat.any():  # nothing was computed since it was made or reset
            self._scratch.qpos[:] = data.qpos
            mujoco.mj_kinematics(model, self._scratch)
            data = self._scratch
        count = data.ncon if data is not self._scratch else 0
        found = [self._contact(data, i) for i in range(count) if data.contact[i].exclude == 0]
        pairs = np.array([one[-1] for one in found], int).reshape(-1, 2)
        trees = islands(model.ntree, pairs)
        tree_of = model.body_treeid[1:]
        of_body = np.where(tree_of >= 0, trees[tree_of], -1) if model.ntree else np.full(model.nbody - 1, -1)
        contacts = Contacts.none()
        if found:
            parts = [np.array([one[k] for one in found]) for k in range(5)]
            of_pair = pairs.max(axis=1)
            contacts = Contacts(*parts, np.where(of_pair >= 0, trees[of_pair], -1) if model.ntree else of_pair)
        return Frame(data.xpos[1:].copy(), data.xquat[1:].copy(), of_body, contacts)

    def _contact(self, data, i):
        """point, frame, force, mu, slip, trees of one contact."""
        model, contact = self._model, data.contact[i]
        force = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, force)
        frame = contact.frame.reshape(3, 3).copy()
        bodies = [int(model.geom_bodyid[geom]) if geom >= 0 else 0 for geom in contact.geom]
        speed, jacobian = [], np.zeros((3, model.nv))
        for body in bodies:
            mujoco.mj_jac(model, data, jacobian, None, contact.pos, body)
            speed.append(jacobian @ data.qvel)
        relative = speed[1] - speed[0]
        mu = contact.friction[:2] * (contact.dim > 1)
        return (contact.pos.copy(), frame, force[:3].copy(), mu.copy(), relative - frame[0] * (frame[0] @ relative),
                [int(model.body_treeid[body]) for body in bodies])
