"""Layout of a Newton model for `stiction.newton`, and the features that are refused."""

from __future__ import annotations

import newton
import numpy as np
import warp as wp

from ..core.layout import offsets_of

_TYPES = newton.JointType
_TAKEN = (_TYPES.FIXED, _TYPES.PRISMATIC, _TYPES.REVOLUTE, _TYPES.BALL, _TYPES.FREE, _TYPES.D6)
#: Features that a model may have beside rigid bodies, and Newton's names of them.
_COUNTS = (("particle_count", "particles"), ("spring_count", "springs"), ("tri_count", "triangles of cloth"),
           ("tet_count", "tetrahedra"), ("muscle_count", "muscles"), ("tendon_count", "tendons"),
           ("attachment_particle_body_count", "attachments of particles to bodies"))
#: Limits beyond it are infinite.
NO_LIMIT = 0.5 * newton.MAXVAL


def _numpy(array, dtype=None):
    found = np.zeros(0) if array is None else array.numpy()
    return found if dtype is None else found.astype(dtype)


def _refuse(found, expected="none"):
    raise ValueError(f"model: SolverStiction has no {found}; expected a model with {expected}")


def _name(labels, i):
    return f"{i} ({labels[i]})" if i < len(labels) and labels[i] else str(i)


def check(model, ignore=()) -> None:
    """Raises ValueError with one sentence that names the first feature of the model that the solver lacks. ignore: rows
    of MuJoCo's own, by frequency, that the caller leaves out."""
    if not model.device.is_cpu:
        raise ValueError(f"model: expected one on cpu, got one on {model.device}: build it with "
                         "builder.finalize(device='cpu')")
    for name, feature in _COUNTS:
        count = int(getattr(model, name, 0) or 0)
        if count:
            _refuse(f"{feature}, of which the model has {count}")
    if int(getattr(model, "constraint_mimic_count", 0) or 0) or \
            (_numpy(getattr(model, "joint_mimic_joint", None), int) >= 0).any():
        _refuse("mimic joints")
    for frequency, count in model.custom_frequency_counts.items():
        if frequency.startswith("mujoco:") and count and frequency not in ignore:
            _refuse(f"'{frequency}', of which the model has {count}",
                    f"drives of joints and Control.joint_f, or ignore=({frequency!r},) to step without them")
    _check_joints(model)
    _check_bodies(model)


def _check_joints(model):
    kinds, labels = _numpy(model.joint_type, int), model.joint_label
    for j in np.flatnonzero(~np.isin(kinds, [int(kind) for kind in _TAKEN])):
        _refuse(f"joints of type {_TYPES(int(kinds[j])).name}, as joint {_name(labels, j)} is",
                "joints of type " + ", ".join(kind.name for kind in _TAKEN))
    for j in np.flatnonzero(_numpy(model.joint_articulation, int) < 0):
        _refuse(f"joints outside articulations, as joint {_name(labels, j)} is", "trees of joints (add_articulation)")
    starts, ends = _numpy(model.articulation_start, int), _numpy(model.articulation_end, int)
    for a in np.flatnonzero(starts[1:] > ends):
        _refuse(f"loops of joints, as joint {_name(labels, ends[a])} closes", "trees of joints")
    for j in np.flatnonzero(~_numpy(model.joint_enabled, bool)):
        _refuse(f"joints that are switched off, as joint {_name(labels, j)} is")
    for j in np.flatnonzero((kinds == _TYPES.FREE) & (_numpy(model.joint_parent, int) >= 0)):
        _refuse(f"free joints on a parent that moves, as joint {_name(labels, j)}", "free joints at the world")
    # A coordinate that is no angle or distance has no limit, spring or drive here.
    turning = np.repeat(np.isin(kinds, (_TYPES.BALL, _TYPES.FREE)), np.diff(_numpy(model.joint_qd_start, int)))
    active = turning & np.isin(_numpy(model.joint_target_mode, int), (1, 2, 3))
    limited = (_numpy(model.joint_limit_lower) > -NO_LIMIT) | (_numpy(model.joint_limit_upper) < NO_LIMIT)
    for found, feature in ((turning & limited, "position limits"),
                           (turning & (_numpy(springs_of(model)[0]) != 0), "springs"),
                           (active & ((_numpy(model.joint_target_ke) != 0) | (_numpy(model.joint_target_kd) != 0)),
                            "drives")):
        for d in np.flatnonzero(found):
            j = np.searchsorted(_numpy(model.joint_qd_start, int), d, side="right") - 1
            _refuse(f"{feature} of ball and free joints, as joint {_name(labels, j)} has")


def _check_bodies(model):
    carried = np.zeros(model.body_count, bool)
    carried[_numpy(model.joint_child, int)] = True
    moved = (_numpy(model.body_flags, int) & int(newton.BodyFlags.KINEMATIC)) == 0
    for body in np.flatnonzero(moved & ~carried):
        _refuse(f"bodies without a joint, as body {_name(model.body_label, body)} is",
                "a joint for each body that moves (add_body makes a free one)")
    if model.world_count > 1:  # a kinematic one may have no joint: it is then at body_q, for all of them
        free = np.diff(_numpy(model.joint_qd_start, int)) > 0
        for j in np.flatnonzero((_numpy(model.joint_world, int) < 0) & free):
            body = _numpy(model.joint_child, int)[j]
            _refuse(f"moving bodies that all worlds share, as body {_name(model.body_label, body)}",
                    "each moving body in one world")


def springs_of(model):
    """Stiffness and rest positions of joints. Newton 1.6 has none, and both are zero then."""
    if hasattr(model, "joint_stiffness"):
        return model.joint_stiffness, model.joint_rest_q
    return tuple(wp.zeros(count, dtype=float, device=model.device)
                 for count in (model.joint_dof_count, model.joint_coord_count))


class Structure:
    """Offsets of each world's articulations, bodies and degrees of freedom. A world is an environment of the batch; a
    model without worlds is one environment."""

    def __init__(self, model, ignore=()):
        check(model, ignore)
        kinds = _numpy(model.joint_type, int)
        self.env_count = max(int(model.world_count), 1)
        self.dof_count = int(model.joint_dof_count)
        qd_start = _numpy(model.joint_qd_start, np.int32)
        starts, ends = _numpy(model.articulation_start, int)[:-1], _numpy(model.articulation_end, int)
        self.first_dof = qd_start[starts].astype(np.int32)
        self.dofs = (qd_start[ends] - self.first_dof).astype(np.int32)
        env_of = self._env_of(_numpy(model.articulation_world, int))
        self.joint_env = self._env_of(_numpy(model.joint_world, int)).astype(np.int32)
        self.dof_env = np.repeat(self.joint_env, np.diff(qd_start))
        self.coordinate_env = np.repeat(self.joint_env, np.diff(_numpy(model.joint_q_start, int)))
        count = np.bincount(self.dof_env, minlength=self.env_count) if self.dof_count else \
            np.zeros(self.env_count, int)
        self.env_dofs = offsets_of(count)
        self._masses(env_of, count)
        self._bodies(model, starts, ends)
        # Coordinates with limits, by degree of freedom.
        scalar = np.repeat(np.isin(kinds, (_TYPES.PRISMATIC, _TYPES.REVOLUTE, _TYPES.D6)), np.diff(qd_start))
        offsets = np.repeat(_numpy(model.joint_q_start, int)[:-1] - qd_start[:-1], np.diff(qd_start))
        self.scalar = scalar
        self.coordinate = np.where(scalar, np.arange(self.dof_count) + offsets, 0)
        self.prescribed = np.zeros(self.dof_count, np.uint8)
        kinematic = (_numpy(model.body_flags, int) & int(newton.BodyFlags.KINEMATIC)) != 0
        self.prescribed[np.repeat(kinematic[_numpy(model.joint_child, int)], np.diff(qd_start))] = 1
        self.shape_body = _numpy(model.shape_body, int)
        self.shape_world = _numpy(model.shape_world, int)
        self.body_moves = np.zeros(model.body_count + 1, bool)  # the last one stands for the world, body -1
        self.body_moves[:-1] = ~kinematic & (self.body_articulation >= 0)

    def _env_of(self, world):
        return np.maximum(world, 0)

    def _masses(self, env_of, count):
        """One block per articulation where all are of a size, else one per environment."""
        sizes = np.unique(self.dofs[self.dofs > 0])
        self.mass_block = int(sizes[0]) if len(sizes) == 1 else 0
        if self.mass_block:
            order = np.cumsum(self.dofs > 0) - 1
            self.mass_start = np.maximum(order, 0) * self.mass_block ** 2
            self.mass_stride = np.full(len(self.dofs), self.mass_block)
            self.mass_entries = int((self.dofs > 0).sum()) * self.mass_block ** 2
        else:
            blocks = offsets_of(count.astype(np.int64) ** 2)
            within = self.first_dof - self.env_dofs[env_of]
            self.mass_start = blocks[env_of] + within * (count[env_of] + 1)
            self.mass_stride = count[env_of]
            self.mass_entries = int(blocks[-1])

    def _bodies(self, model, starts, ends):
        """Articulation and link of each body that has degrees of freedom above it; -1 of others."""
        self.body_articulation = np.full(model.body_count, -1, np.int32)
        self.body_link = np.zeros(model.body_count, np.int32)
        child = _numpy(model.joint_child, int)
        for a, (start, end) in enumerate(zip(starts, ends)):
            if self.dofs[a]:
                self.body_articulation[child[start:end]] = a
                self.body_link[child[start:end]] = np.arange(end - start)
