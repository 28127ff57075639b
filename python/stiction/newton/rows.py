"""Rows of contacts, limits and friction of joints for `stiction.newton`, and the impulses that they start from."""

from __future__ import annotations

import numpy as np
import warp as wp

from ..core.layout import KINDS, offsets_of
from . import kernels
from .model import NO_LIMIT

#: Change of velocity [m/s or rad/s] within which a limit is a row. A faster one is corrected in the next step.
_REACH = 20.0
#: Residual that a solve in float64 can reach, relative to max |b|.
_LEAST_TOLERANCE = 1e-13
_LOWER, _UPPER, _DRY, _CONTACT = range(4)  # the order of a world's rows
_CONE = np.array([KINDS["unilateral"], KINDS["unilateral"], KINDS["box"], KINDS["friction"]], np.uint8)
_MOST_PER_PAIR = 1 << 20


def _f64(array):
    return array.numpy().astype(np.float64)


class Rows:
    """The rows of one step, world by world: limits, friction of joints, contacts by their shapes."""

    def __init__(self, model, structure, J, prescribed, contact_dim, erp, slop, recovery, threshold):
        self._model, self._structure, self._J, self._prescribed = model, structure, J, prescribed
        self._dim, self._erp, self._slop, self._recovery, self._threshold = contact_dim, erp, slop, recovery, threshold
        self._link = [wp.array(np.ascontiguousarray(a), dtype=int, device=model.device) for a in (
            structure.body_articulation, structure.body_link, structure.first_dof, structure.dofs)]
        self._kept = None  # start of the next solve
        self.forget(None)

    # -- the rows -----------------------------------------------------------------------------------------------------

    def collect(self, state, contacts, v_free, dt):
        """Finds the rows of this step; fills kinds, dims, offsets, indptr, columns, values, target, mu, lo, hi, b."""
        structure = self._structure
        dofs, classes, bounds = self._of_joints(state, v_free, dt)
        which, envs, entries = self._of_contacts(contacts)
        self._which, self._contacts, self._dofs, self._classes = which, contacts, dofs, classes
        joints = len(dofs)
        env = np.concatenate([structure.dof_env[dofs], envs]).astype(np.int64)
        kind = np.concatenate([classes, np.full(len(which), _CONTACT)])
        dims = np.concatenate([np.ones(joints, np.int64), np.full(len(which), self._dim, np.int64)])
        entries = np.concatenate([np.ones(joints, np.int64), entries])
        order = np.lexsort((kind, env))
        rows, ends = self._starts(order, dims), self._starts(order, dims * entries)
        self.row_count, entry_count = int(dims.sum()), int((dims * entries).sum())
        if entry_count > np.iinfo(np.int32).max:
            raise ValueError("model: expected less than 2^31 entries of contact Jacobians in a step, got "
                             f"{entry_count}")
        self._joint_row, self._contact_row = rows[:joints], rows[joints:].astype(np.int32)
        self.kinds, self.dims, self._cone_row = _CONE[kind[order]], dims[order], rows[order]
        self.offsets = offsets_of(np.bincount(env, dims, structure.env_count).astype(np.int64))
        self.indptr = offsets_of(np.repeat(entries[order], dims[order]))
        self.values, self.columns = np.zeros(entry_count), np.zeros(entry_count, np.int32)
        self.target, self.mu, self.lo, self.hi, self.b = (np.zeros(self.row_count) for _ in range(5))
        at, row = ends[:joints], self._joint_row
        self.values[at] = np.where(classes == _UPPER, -1.0, 1.0)
        self.columns[at] = dofs - structure.env_dofs[env[:joints]]
        dry = classes == _DRY
        self.target[row] = np.where(dry, 0.0, bounds)
        self.b[row] = self.values[at] * v_free[dofs] - self.target[row]
        self.lo[row], self.hi[row] = np.where(dry, -bounds, 0.0), np.where(dry, bounds, 0.0)
        if len(which):
            self._fill(state, contacts, v_free, ends[joints:].astype(np.int32), envs, dt)

    @staticmethod
    def _starts(order, sizes):
        starts = np.empty(len(order), np.int64)
        starts[order] = np.cumsum(sizes[order]) - sizes[order]
        return starts

    def _of_joints(self, state, v_free, dt):
        """Degrees of freedom with a row, which row it is, and the velocity or impulse that bounds it."""
        model, structure = self._model, self._structure
        free = structure.prescribed == 0
        q = _f64(state.joint_q)[structure.coordinate]
        fastest = _f64(model.joint_velocity_limit)
        near = 2 * np.abs(v_free) + _REACH
        found = []
        for kind, limit, gap in ((_LOWER, model.joint_limit_lower, 1.0), (_UPPER, model.joint_limit_upper, -1.0)):
            limit = _f64(limit)
            gap = np.where(structure.scalar & (np.abs(limit) < NO_LIMIT), gap * (q - limit), np.inf)
            least = np.where(gap >= 0, -gap / dt, np.minimum(-self._erp * gap / dt, self._recovery))
            least = np.maximum(least, -fastest)
            dofs = np.flatnonzero(free & (least > -near))
            found.append((dofs, np.full(len(dofs), kind), least[dofs]))
        dry = _f64(model.joint_friction)
        dofs = np.flatnonzero(free & (dry > 0))
        found.append((dofs, np.full(len(dofs), _DRY), dry[dofs] * dt))
        return [np.concatenate(parts) for parts in zip(*found)]

    def _of_contacts(self, contacts):
        """Contacts that push something, by world and shapes; their worlds, and entries of each of their rows."""
        nothing = np.zeros(0, np.int32), np.zeros(0, np.int64), np.zeros(0, np.int64)
        if contacts is None:
            return nothing
        self._check(contacts)
        count, room = int(contacts.rigid_contact_count.numpy()[0]), contacts.rigid_contact_max
        if count > room:
            raise ValueError(f"contacts: {count} were found and there is room for {room}: make the CollisionPipeline "
                             f"with rigid_contact_max of at least {count}")
        structure = self._structure
        s0, s1 = contacts.rigid_contact_shape0.numpy()[:count], contacts.rigid_contact_shape1.numpy()[:count]
        b0, b1 = structure.shape_body[s0], structure.shape_body[s1]
        pushes = (s0 >= 0) & (s1 >= 0) & (structure.body_moves[b0] | structure.body_moves[b1])
        which = np.flatnonzero(pushes)
        if not len(which):
            return nothing
        s0, s1, b0, b1 = (array[which].astype(np.int64) for array in (s0, s1, b0, b1))
        env = np.maximum(np.maximum(structure.shape_world[s0], structure.shape_world[s1]), 0)
        order = np.lexsort((which, s1, s0, env))
        which, s0, s1, b0, b1, env = (array[order] for array in (which, s0, s1, b0, b1, env))
        pair = s0 * len(structure.shape_body) + s1
        begins = np.flatnonzero(np.concatenate([[True], pair[1:] != pair[:-1]]))
        number = np.arange(len(pair)) - np.repeat(begins, np.diff(np.append(begins, len(pair))))
        self._keys = pair * _MOST_PER_PAIR + number
        a0, a1 = (np.where(body >= 0, structure.body_articulation[body], -1) for body in (b0, b1))
        dofs = np.append(structure.dofs, 0)  # of articulation -1
        return which.astype(np.int32), env, (dofs[a0] + np.where(a1 == a0, 0, dofs[a1])).astype(np.int64)

    @staticmethod
    def _check(contacts):
        # Newton 1.6 has neither of two of them.
        if getattr(contacts, "rigid_contact_body_pair_reduced", False):
            raise ValueError("contacts: SolverStiction has no body-pair-reduced contacts; make the CollisionPipeline "
                             "without body_pair_reduction")
        if contacts.rigid_contact_friction is not None:
            raise ValueError("contacts: SolverStiction has no contacts with properties of their own (hydroelastic "
                             "shapes); expected contacts with the properties of their shapes")
        if getattr(contacts, "rigid_contact_surface_velocity", None) is not None:
            raise ValueError("contacts: SolverStiction has no surface velocities (conveyors); expected contacts "
                             "without them")

    def _geometry(self, contacts):
        return [contacts.rigid_contact_shape0, contacts.rigid_contact_shape1, contacts.rigid_contact_point0,
                contacts.rigid_contact_point1, contacts.rigid_contact_offset0, contacts.rigid_contact_offset1,
                contacts.rigid_contact_normal]

    def _fill(self, state, contacts, v_free, entry_start, envs, dt):
        """The contacts' part of the arrays, by Warp, in place."""
        model, over = self._model, self._over
        env_dof = self._structure.env_dofs[envs].astype(np.int32)
        wp.launch(kernels.contact_rows, len(self._which), [
            over(self._which, int), over(self._contact_row, int), over(entry_start, int), over(env_dof, int),
            self._dim, *self._geometry(contacts), contacts.rigid_contact_margin0, contacts.rigid_contact_margin1,
            model.shape_body, state.body_q, state.body_qd, model.body_com, *self._link, self._J, state.joint_qd,
            over(v_free, wp.float64), self._prescribed,
            model.shape_material_mu, model.shape_material_mu_torsional, model.shape_material_mu_rolling,
            model.shape_material_restitution, dt, self._erp, self._slop, self._recovery, self._threshold],
            [over(self.values, wp.float64), over(self.columns, int), over(self.target, wp.float64),
             over(self.mu, wp.float64), over(self.b, wp.float64)], device=model.device)

    def _over(self, array, dtype):
        return wp.array(array, dtype=dtype, device=self._model.device, copy=False)

    # -- warm starts --------------------------------------------------------------------------------------------------

    def guess(self, share, dt):
        """Impulses to start from: of each joint's row, and of each contact, the last ones. None: nothing is kept."""
        if self._kept is None:
            return None
        joints, impulses, last_dt = self._kept
        scale = share * dt / last_dt
        found = np.zeros(self.row_count)
        found[self._joint_row] = scale * joints[self._classes, self._dofs]
        if len(self._which) and len(impulses):
            previous = self._previous()
            hit = previous >= 0
            rows = self._contact_row[hit][:, None] + np.arange(self._dim)
            found[rows] = scale * impulses[previous[hit]]
        return found

    def _previous(self):
        """Which contact of the last solve each one was, -1: none. With Newton's matching in the same buffer, its
        entry; if that is empty, the contact with that number of the same pair of shapes."""
        contacts, which = self._contacts, self._which
        by_shapes = self._by_shapes()
        if contacts is not self._last_contacts:
            return by_shapes
        if int(contacts.contact_generation.numpy()[0]) == self._last_generation:
            return self._of_place[which]
        matched = getattr(contacts, "rigid_contact_match_generation", None)  # which Newton 1.6 does not document
        if not contacts.contact_matching or matched is None or int(matched.numpy()[0]) != self._last_generation:
            return by_shapes
        match = contacts.rigid_contact_match_index.numpy()[which]
        known = (match >= 0) & (match < len(self._of_place))
        return np.where(known, self._of_place[np.where(known, match, 0)], by_shapes)

    def _by_shapes(self):
        place = np.searchsorted(self._last_keys, self._keys, sorter=self._by_key)
        place = self._by_key[np.minimum(place, len(self._last_keys) - 1)]
        return np.where(self._last_keys[place] == self._keys, place, -1)

    def keep(self, impulses, dt):
        """Keeps the impulses of this step. Rows of worlds without a usable answer are zero."""
        joints = np.zeros((3, self._structure.dof_count))
        joints[self._classes, self._dofs] = impulses[self._joint_row]
        contacts, which = self._contacts, self._which
        rows = self._contact_row[:, None] + np.arange(self._dim)
        self._contact_env = np.searchsorted(self.offsets, self._contact_row, side="right") - 1
        self._kept = joints, impulses[rows], dt
        self._last_contacts = contacts
        if contacts is None or not len(which):
            self._last_contacts = None
            return
        self._last_keys, self._by_key = self._keys, np.argsort(self._keys, kind="stable")
        self._last_generation = int(contacts.contact_generation.numpy()[0])
        self._of_place = np.full(int(contacts.rigid_contact_count.numpy()[0]), -1)
        self._of_place[which] = np.arange(len(which))

    def forget(self, mask):
        """Drops the impulses of worlds where the mask is set (its last entry: of a model without worlds), or all."""
        if mask is None or self._kept is None:
            self._kept = None
            self._last_contacts = None
            return
        gone = mask[:self._structure.env_count].copy()
        if self._structure.env_count == 1:
            gone |= mask[-1]
        joints, impulses, _ = self._kept
        joints[:, gone[self._structure.dof_env]] = 0
        impulses[gone[self._contact_env]] = 0

    # -- forces -------------------------------------------------------------------------------------------------------

    def write_forces(self, impulses, state, contacts, dt, contact_f):
        """Contact forces of this step where Newton's observables have them."""
        if not len(self._which):
            return
        model, over = self._model, self._over
        wp.launch(kernels.contact_forces, len(self._which), [
            over(self._which, int), over(self._contact_row, int), self._dim, *self._geometry(contacts),
            model.shape_body, state.body_q, model.body_com, over(impulses, wp.float64), dt], [contact_f], device=model.device)
