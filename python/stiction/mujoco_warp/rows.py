"""MuJoCo Warp's constraint rows as batches of J and M: its arrays where they lie, and further arrays beside them."""

from __future__ import annotations

import numpy as np
import warp as wp
from mujoco_warp._src import derivative, types

from ..core.arrays import STATUS_DTYPE, framework_of
from ..core.batch import Batch
from ..core.solution import CODES, Solution
from . import kernels

_SOLVED, _NUMERICAL = CODES.index("solved"), CODES.index("numerical")
#: Overflow bits of MuJoCo Warp by which contacts are missing from a world's rows.
_LOST = int(types.OverflowType.NJMAX_NNZ | types.OverflowType.CCD | types.OverflowType.HFIELD)


def words_of(status):
    """Status records as eight 32-bit words each, over the same memory."""
    shape = status.shape[0], STATUS_DTYPE.itemsize // 4
    return wp.array(ptr=status.ptr, dtype=int, shape=shape, device=status.device)


def memory_of(model, data):
    """Arrays that a batch is made of: it holds as long as they do not change."""
    efc, contact = data.efc, data.contact
    arrays = (efc.J, efc.aref, efc.force, data.qacc, data.qacc_smooth, contact.friction)
    return (tuple(array.ptr for array in arrays), int(model.opt.integrator),
            int(model.opt.enableflags) & int(types.EnableBit.SLEEP))


class _Layout:
    """Cones of each world, which the device counts: a stand-in for the layouts of stiction.Batch."""

    padded, fixed = True, False

    def __init__(self, worlds, room, kind, rows, row_count, cone_count, flags):
        self.env_count, self.room, self.cone_room = worlds, room, room
        self.row_count, self.cone_count = worlds * room, worlds * (room + 1)
        self.row_shape = self.cone_shape = (worlds, room)
        first = np.arange(worlds + 1, dtype=np.int64)
        self.integers = {
            "env_row_offsets": first * room, "env_cone_offsets": first * (room + 1), "env_row_counts": row_count,
            "env_cone_counts": cone_count, "env_flags": flags, "cone_kind": kind, "cone_row_offsets": rows}

    def refresh(self):
        """Its numbers are written before each solve."""

    def has(self, kind):
        """True if there may be cones of a kind: those that MuJoCo's rows are."""
        return kind in ("free", "unilateral", "box", "friction")

    def rows_of(self, env):
        """The rows of one world that are in use, as (world, rows)."""
        return env, slice(0, int(self.integers["env_row_counts"].numpy()[env]))


def _batch(layout, J, M, v_free, target, R, mu, lo, hi, law):
    """A batch over Warp's arrays. Rows of J may have more room than degrees of freedom, as MuJoCo Warp's have."""
    batch = Batch("jacobian", framework_of(J), "float32", "cpu" if J.device.is_cpu else str(J.device), law)
    batch.factored, batch.mass_block, batch.layout = False, 0, layout
    worlds, dofs = v_free.shape
    batch.dof_shape = (worlds, dofs)
    batch._numbers("J", J, J.shape)
    batch._numbers("M", M, (worlds, dofs, dofs))
    first = np.arange(worlds + 1, dtype=np.int64)
    rows = np.arange(layout.room, dtype=np.int64) * J.shape[2]
    begin = (first[:-1, None] * (J.shape[1] * J.shape[2]) + rows).ravel()
    batch._integers({"row_offsets": np.append(begin, J.size), "env_dof_offsets": first * dofs,
                     "env_mass_offsets": first * dofs * dofs})
    batch._integers(layout.integers)
    batch._numbers("v_free", v_free, v_free.shape)
    for name, value in (("target", target), ("R", R), ("mu", mu), ("lo", lo), ("hi", hi)):
        batch._numbers(name, value, layout.row_shape)
    return batch


class Rows:
    """The batch of one pair of model and data. All memory is taken here; `collect` only writes."""

    def __init__(self, model, data):
        self.model, self.data = model, data
        device, worlds, room, dofs = data.qacc.device, data.nworld, data.njmax, model.nv
        self.frozen = bool(model.opt.enableflags & types.EnableBit.SLEEP)
        self.discrete = model.opt.integrator == types.IntegratorType.DISCRETE

        def zeros(shape, dtype=float):
            return wp.zeros(shape, dtype=dtype, device=device)

        self._zeros = zeros
        self.R, self.mu, self.lo, self.hi = (zeros((worlds, room)) for _ in range(4))
        self.M = zeros((worlds, dofs, dofs))
        self.row_count, self.cone_count, self.flags = (zeros(worlds, int) for _ in range(3))
        self.kinds, self.cone_rows = self.cones()
        # Rows of its sparse J are in no order, and sleeping degrees of freedom must not be seen.
        packs = model.is_sparse or self.frozen
        self.J = zeros((worlds, room, dofs)) if packs else data.efc.J
        self.free = data.qacc_smooth  # 0 where it sleeps
        self.place = data.dof_cdof
        if self.discrete:  # whose solve MuJoCo Warp does not compact
            self._unit, self._product = zeros((worlds, dofs)), zeros((worlds, dofs))
            self.place = zeros((worlds, dofs), int)
        self.friction = wp.array(ptr=data.contact.friction.ptr, dtype=float, shape=(data.contact.friction.shape[0], 5),
                                 device=device)
        layout = _Layout(worlds, room, self.kinds, self.cone_rows, self.row_count, self.cone_count, self.flags)
        self.batch = _batch(layout, self.J, self.M, self.free, data.efc.aref, self.R, self.mu, self.lo, self.hi,
                            "convex")
        status = zeros((worlds, STATUS_DTYPE.itemsize), wp.uint8)
        self.solution = Solution.over(self.batch, {"lambda_": data.efc.force, "velocities": data.qacc,
                                                   "status": status})
        self.words = words_of(status)

    def cones(self):
        """Room for the kinds of cones, and for where they begin."""
        worlds, room = self.data.nworld, self.data.njmax
        rows = np.full(worlds * (room + 1) + 1, worlds * room, np.int64)
        rows[:-1].reshape(worlds, room + 1)[:] = np.arange(worlds)[:, None] * room
        return self._zeros(worlds * (room + 1), wp.uint8), wp.from_numpy(rows, device=self.data.qacc.device)

    def launch(self, kernel, shape, inputs, outputs):
        wp.launch(kernel, dim=shape, inputs=inputs, outputs=outputs, device=self.data.qacc.device)

    @property
    def _per_row(self):
        return self.data.nworld, self.data.njmax

    @property
    def _per_dof(self):
        return self.data.nworld, self.model.nv

    def collect(self):
        """Reads the present rows and mass matrices."""
        model, data, efc = self.model, self.data, self.data.efc
        self.launch(kernels.fill_cones, data.nworld,
                    [data.nefc, data.njmax, efc.type, efc.id, data.contact.dim, data.nacon, data.ncollision,
                     data.naconmax, data.overflow, _LOST],
                    [self.row_count, self.cone_count, self.flags, self.kinds, self.cone_rows])
        self.launch(kernels.fill_rows, self._per_row,
                    [self.row_count, efc.type, efc.id, efc.D, efc.frictionloss, self.friction,
                     data.contact.efc_address],
                    [self.R, self.mu, self.lo, self.hi])
        if self.frozen and self.discrete:
            self.launch(kernels.fill_awake, self._per_dof, [model.dof_treeid, data.tree_awake], [self.place])
        if self.J is not efc.J:
            self.launch(kernels.fill_jacobian, self._per_row,
                        [self.row_count, model.is_sparse, efc.J_rownnz, efc.J_rowadr, efc.J_colind, efc.J, self.place,
                         self.frozen], [self.J])
        if not self.discrete:
            self.launch(kernels.fill_mass, self._per_dof,
                        [model.M_rownnz, model.M_rowadr, model.M_colind, data.M, self.place, self.frozen], [self.M])
            return
        for column in range(model.nv):  # its effective metric is known by products alone
            self.launch(kernels.unit_vector, self._per_dof, [column], [self._unit])
            derivative.eff_mul_m(model, data, self._product, self._unit)
            self.launch(kernels.fill_mass_column, self._per_dof, [column, self._product, self.place, self.frozen],
                        [self.M])

    def write(self, words, more=False):
        """Computes the results of forces and accelerations. words: of the status of the solve that found them; more:
        its iterations add to those that are there."""
        model, data, efc = self.model, self.data, self.data.efc
        self.launch(kernels.judge_numbers, data.nworld, [data.qacc, _SOLVED, _NUMERICAL], [words])
        self.launch(kernels.write_states, self._per_row,
                    [data.nefc, self.row_count, efc.type, efc.id, data.contact.dim, data.contact.efc_address,
                     self.friction, efc.frictionloss], [efc.force, efc.state])
        self.launch(kernels.write_forces, self._per_dof, [self.row_count, self.J, efc.force], [data.qfrc_constraint])
        derivative.eff_mul_m(model, data, efc.Ma, data.qacc)  # start of integrators; M outside of `discrete`
        self.launch(kernels.write_counts, data.nworld,
                    [words, int(types.OverflowType.ITERATIONS), more], [data.solver_niter, data.overflow])


class Friction:
    """The problem that MuJoCo's noslip sweeps: friction without softness, all other forces held. Two batches: one
    whose forces are all held, for the accelerations that they make, and one of friction alone."""

    def __init__(self, rows):
        self._rows, data = rows, rows.data
        worlds, room, dofs = data.nworld, data.njmax, rows.model.nv
        zeros = rows._zeros
        self._held, self._found, self._target, self._lo, self._hi, self._R = (zeros((worlds, room)) for _ in range(6))
        self._J, self._pushed = zeros((worlds, room, dofs)), zeros((worlds, dofs))
        self._held_kinds, self._held_rows = rows.cones()
        self._kinds = zeros(worlds * (room + 1), wp.uint8)
        counts = rows.row_count, rows.cone_count, rows.flags
        layout = _Layout(worlds, room, self._held_kinds, self._held_rows, rows.row_count, rows.row_count, rows.flags)
        self.held = _batch(layout, rows.J, rows.M, rows.free, data.efc.aref, rows.R, rows.mu, self._held, self._held,
                           "convex")
        layout = _Layout(worlds, room, self._kinds, rows.cone_rows, *counts)
        # Coulomb's law keeps a normal force that no friction moves; the convex law would not.
        self.batch = _batch(layout, self._J, rows.M, self._pushed, self._target, self._R, rows.mu, self._lo, self._hi,
                            "coulomb")
        status = [zeros((worlds, STATUS_DTYPE.itemsize), wp.uint8) for _ in range(2)]
        self.pushed = Solution.over(self.held, {"lambda_": self._found, "velocities": self._pushed,
                                                "status": status[0]})
        self.solution = Solution.over(self.batch, {"lambda_": self._found, "velocities": data.qacc,
                                                   "status": status[1]})
        self.words = words_of(status[1])

    def hold(self):
        """Reads the forces that stay."""
        rows, efc, address = self._rows, self._rows.data.efc, self._rows.data.contact.efc_address
        rows.launch(kernels.hold_forces, rows._per_row, [rows.row_count, efc.type, efc.id, address, efc.force],
                    [self._held])
        rows.launch(kernels.fill_friction_cones, rows.data.nworld,
                    [rows.row_count, rows.cone_count, efc.type, rows.kinds, rows.cone_rows, rows.data.njmax],
                    [self._kinds, self._held_kinds, self._held_rows])
        rows.launch(kernels.fill_friction, rows._per_row,
                    [rows.row_count, efc.type, efc.id, address, efc.frictionloss, efc.aref, self._held, rows.J],
                    [self._J, self._target, self._R, self._lo, self._hi])

    def join(self):
        """Puts friction beside them."""
        rows, efc = self._rows, self._rows.data.efc
        rows.launch(kernels.join_forces, rows._per_row,
                    [rows.row_count, efc.type, efc.id, rows.data.contact.efc_address, self._held, self._found],
                    [efc.force])
