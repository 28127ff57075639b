"""Newton (newton-physics.github.io) with stiction as its solver, on the CPU.

    solver = stiction.newton.SolverStiction(model, law="coulomb", tolerance=1e-6)
    solver.step(state_in, state_out, control, contacts, dt)         # as any of newton.solvers
    solver.status["residual"], solver.status["code"]                # one record for each world

Contacts, limits and friction of joints of all worlds are solved in one call, each world to the tolerance and apart
from the others. docs/howto/newton.md.
"""

from __future__ import annotations

import newton
import numpy as np
import warp as wp

from ..core.arguments import not_negative, number
from ..core.arrays import STATUS_DTYPE
from ..core.batch import Batch
from ..core.solution import CODES
from ..core.solver import Solver
from . import kernels
from .model import Structure, springs_of
from .rows import Rows

__all__ = ["SolverStiction"]

_UNUSABLE = [CODES.index(name) for name in ("invalid_input", "numerical", "unsupported")]
_SOLVED, _NUMERICAL = CODES.index("solved"), CODES.index("numerical")


class SolverStiction(newton.solvers.SolverBase):
    """Steps articulations and free bodies of a Newton model in reduced coordinates. Contacts are rigid, with friction
    by the law that is asked for.

    model: on the CPU. A feature that the solver lacks is refused by a ValueError that names it.
    law: "coulomb", exact friction, or "convex", as MuJoCo's and Drake's.
    solver, max_iterations, threads: as of stiction.Solver.
    tolerance: on each world's residual, divided by the largest velocity that its contacts and limits have to change.
    contact_dim: rows of a contact, 3; 4 with torsional friction (mu_torsional); 6 with rolling friction, too.
    erp: share of a penetration undone in a step, not faster than recovery_speed [m/s]; slop [m] is left alone.
    restitution_threshold: closing speed [m/s] above which shapes bounce.
    warm_start: share of a row's last impulse, by length of the step, that a solve starts from; 0: from none.
    hold_failed: put a world back to its last good state whose step had no usable input or answer (NaN in its state,
        for instance). Else its bodies get the velocities that the solve returned, which may be NaN.
    ignore: features of MuJoCo's own in the model to step without, as "mujoco:actuator" of an MJCF file; else it is
    refused.

    Attributes: solver, the stiction.Solver, with stats(). Results of the last step are status, failed, and batch and
    solution, for stiction.verify.
    """

    if hasattr(newton.solvers.SolverBase, "ObservableKind"):  # not in Newton 1.6, which Isaac Lab 3.0.0 asks for
        SUPPORTED_OBSERVABLES = frozenset({newton.solvers.SolverBase.ObservableKind.CONTACT_F})

    def __init__(self, model, *, law="coulomb", solver="auto", tolerance=1e-6, max_iterations=1000, threads=0,
                 contact_dim=3, erp=0.2, slop=0.0, recovery_speed=1.0, restitution_threshold=0.1, warm_start=1.0,
                 hold_failed=False, ignore=()):
        super().__init__(model)
        if contact_dim not in (3, 4, 6):
            raise ValueError(f"contact_dim: expected 3, 4 or 6, got {contact_dim!r}")
        if not 0 <= float(warm_start) <= 1:
            raise ValueError(f"warm_start: expected a number in [0, 1], got {warm_start}")
        if law not in ("convex", "coulomb"):
            raise ValueError(f"law: expected 'convex' or 'coulomb', got {law!r}")
        self.solver = Solver(device="cpu", solver=solver, tolerance=tolerance, max_iterations=max_iterations,
                             threads=threads)
        self.law, self.hold_failed = law, bool(hold_failed)
        self._share, self._ignore = float(warm_start), tuple(ignore)
        if not 0 <= number("erp", erp) <= 1:
            raise ValueError(f"erp: expected a number in [0, 1], got {erp}")
        self._options = (int(contact_dim), float(erp), not_negative("slop", slop),
                         not_negative("recovery_speed", recovery_speed),
                         not_negative("restitution_threshold", restitution_threshold))
        self.batch = self.solution = None
        self._good = wp.clone(model.joint_q), wp.clone(model.joint_qd)  # state to which failed worlds are put back
        self._read_model()

    @property
    def status(self) -> np.ndarray:
        """Records (worlds,) of the last step: code, flags, iterations, residual, residual_abs, solver."""
        return np.zeros(self._structure.env_count, STATUS_DTYPE) if self.solution is None else self.solution.status

    @property
    def failed(self) -> np.ndarray:
        """Indices of the worlds that had no usable input or answer in the last step."""
        return np.flatnonzero(self._failed)

    # -- Newton's interface -------------------------------------------------------------------------------------------

    def step(self, state_in, state_out, control, contacts, dt, *, observables=None):
        """Advances by dt [s]. contacts: of a CollisionPipeline, found at state_in; None: no contacts."""
        model, structure, dt = self.model, self._structure, float(dt)
        if not dt > 0:
            raise ValueError(f"dt: expected a positive number, got {dt}")
        if observables is not None:
            self.validate_observables(observables, contacts)
        if control is None:
            control = model.control(clone_variables=False)
        if state_in is not state_out and model.body_count:
            wp.copy(state_out.body_q, state_in.body_q)
            wp.copy(state_out.body_qd, state_in.body_qd)
        if not structure.dof_count:
            return
        newton.eval_fk(model, state_in.joint_q, state_in.joint_qd, state_in)
        self._move_freely(state_in, control, dt)
        rows = self._rows
        rows.collect(state_in, contacts, self._v_free.numpy(), dt)
        self.batch = Batch.from_jacobian(
            rows.values, self._factor.numpy(), self._v_free.numpy(), rows.target, kinds=rows.kinds, dims=rows.dims,
            offsets=rows.offsets, dof_offsets=structure.env_dofs, indptr=rows.indptr, indices=rows.columns,
            mass_block=structure.mass_block, mass_form="factor", mu=rows.mu, lo=rows.lo, hi=rows.hi, law=self.law)
        guess = rows.guess(self._share, dt) if self._share > 0 else None
        self.solution = self.solver.solve(self.batch, warm_start=guess)
        rows.keep(self.solution.lambda_, dt)
        self._dt = dt
        if observables is not None and observables.is_requested(self.ObservableKind.CONTACT_F):
            observables.contact_f.zero_()
            rows.write_forces(self.solution.lambda_, state_in, contacts, dt, observables.contact_f)
        self._advance(state_in, state_out, dt)  # last: the states may be one

    def update_contacts(self, contacts, state=None):
        """Writes contact forces of the last step into `contacts.force`, as Newton 1.6 asks and Isaac Lab's contact sensors.
        contacts: those given to that step, with room for forces. state: the bodies where torques are counted; needed.
        """
        if getattr(contacts, "force", None) is None or state is None:
            raise ValueError("contacts, state: expected contacts with forces (model.request_contact_attributes('force')) "
                             "and a state, got one without")
        contacts.force.zero_()
        if self.solution is not None:
            self._rows.write_forces(self.solution.lambda_, state, contacts, self._dt, contacts.force)

    def reset(self, state, world_mask=None, flags=None):
        """Drops the start of the next solve of those worlds."""
        mask = self._normalize_reset_world_mask(world_mask)
        self._rows.forget(None if mask is None else mask.numpy())

    def notify_model_changed(self, flags):
        """Reads the model again: kinematic bodies, features that are refused. Numbers are read at every step."""
        self._read_model()

    # -- the stages ---------------------------------------------------------------------------------------------------

    def _read_model(self):
        model = self.model
        self._structure = structure = Structure(model, self._ignore)
        self._failed = np.zeros(structure.env_count, bool)
        most, links = model.max_dofs_per_articulation, model.max_joints_per_articulation

        def over(array, dtype):
            return wp.array(np.ascontiguousarray(array), dtype=dtype, device=model.device)

        count = model.articulation_count
        self._J = wp.zeros((count, 6 * links, most), dtype=float, device=model.device)
        self._H = wp.zeros((count, most, most), dtype=float, device=model.device)
        self._gravity, self._coriolis, = (wp.zeros(structure.dof_count, dtype=float, device=model.device)
                                          for _ in range(2))
        self._force, self._softness, self._v_free = (
            wp.zeros(structure.dof_count, dtype=wp.float64, device=model.device) for _ in range(3))
        self._factor = wp.zeros(structure.mass_entries, dtype=wp.float64, device=model.device)
        self._mass_start = over(structure.mass_start, int)
        self._mass_stride = over(structure.mass_stride, int)
        self._prescribed = over(structure.prescribed, wp.uint8)
        self._joint_env = over(structure.joint_env, int)
        self._rows = Rows(model, structure, self._J, self._prescribed, *self._options)

    def _move_freely(self, state, control, dt):
        """Mass matrix, and velocities at the end of a step without contact."""
        model = self.model
        newton.eval_jacobian(model, state, J=self._J)
        newton.eval_mass_matrix(model, state, H=self._H, J=self._J)
        newton.eval_inverse_dynamics_passive(model, state, gravity_force=self._gravity,
                                             coriolis_force=self._coriolis)
        wp.launch(kernels.joint_forces, model.joint_count, [
            model.joint_type, model.joint_parent, model.joint_X_p, model.joint_q_start, model.joint_qd_start,
            state.body_q, state.joint_q, state.joint_qd, control.joint_f, self._gravity, self._coriolis,
            control.joint_target_q, control.joint_target_qd, model.joint_target_mode, model.joint_target_ke,
            model.joint_target_kd, model.joint_effort_limit, *springs_of(model), model.joint_damping, dt],
            [self._force, self._softness], device=model.device)
        wp.launch(kernels.free_motion, model.articulation_count, [
            model.articulation_start, model.articulation_end, model.joint_qd_start, model.joint_child, self._H,
            self._J, state.joint_qd, self._force, self._softness, self._prescribed, state.body_f, dt, self._mass_start,
            self._mass_stride], [self._factor, self._v_free], device=model.device)

    def _advance(self, state_in, state_out, dt):
        """Writes the state at the end of the step."""
        model, structure = self.model, self._structure
        velocity = self.solution.velocities
        finite = np.isfinite(velocity)
        self._failed = np.isin(self.solution.status["code"], _UNUSABLE)
        self._failed[structure.dof_env[~finite]] = True
        held = self._failed if self.hold_failed else np.zeros_like(self._failed)
        wp.launch(kernels.move_joints, model.joint_count, [
            model.joint_type, model.joint_child, model.joint_q_start, model.joint_qd_start, model.joint_X_c,
            model.body_com, self._joint_env, wp.array(held.astype(np.uint8), device=model.device), state_in.joint_q,
            wp.array(velocity, dtype=wp.float64, device=model.device, copy=False), dt, *self._good],
            [state_out.joint_q, state_out.joint_qd], device=model.device)
        for new, env in ((state_out.joint_q, structure.coordinate_env), (state_out.joint_qd, structure.dof_env)):
            self._failed[env[~np.isfinite(new.numpy())]] = True
        code = self.solution.status["code"]  # a world without rows is solved, whatever its numbers
        wrong = self._failed & (code == _SOLVED)
        code[wrong] = _NUMERICAL
        self.solver._statistics.recode(int(wrong.sum()), _SOLVED, _NUMERICAL)
        newton.eval_fk(model, state_out.joint_q, state_out.joint_qd, state_out)
        if self.hold_failed:
            for good, new, env in zip(self._good, (state_out.joint_q, state_out.joint_qd),
                                      (structure.coordinate_env, structure.dof_env)):
                well = ~self._failed[env]
                good.numpy()[well] = new.numpy()[well]
