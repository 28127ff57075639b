#pragma once

#include "core/algorithm/rigid/contact_point.hpp"
#include "core/job/body_job.hpp"
#include "core/job/cone_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// Options of a body solve, as plain numbers; the same for every environment.
struct SiParams {
  double step;  ///< length of a sub-step [s]
  double erp, slop, cfm, restitution_threshold;
  double tolerance, absolute_tolerance, omega;
  Index iterations, substeps;
  bool momentum;
  SolverKind answered_by;  ///< solver of the status
};

STICTION_HD SolverKind body_solver_kind(const BodySolverOptions& options) {
  if (options.method == BodyMethod::newton)
    return options.space.preconditioner == BodyPreconditioner::multigrid ? SolverKind::multigrid : SolverKind::newton;
  return options.momentum ? SolverKind::npgs : SolverKind::pgs;
}

STICTION_HD SiParams si_params(const TimeStepping& stepping, const BodySolverOptions& options) {
  return {div_(stepping.dt, static_cast<double>(options.substeps)),
          stepping.erp,
          stepping.slop,
          stepping.cfm,
          stepping.restitution_threshold,
          options.tolerance,
          options.absolute_tolerance,
          options.omega,
          options.iterations,
          options.substeps,
          options.momentum,
          body_solver_kind(options)};
}

/// One environment of a body batch with its part of the plan and of the outputs. Shapes as in BodyBatchView and
/// BodyPlanData, counted from the environment's own zero.
template <class Real>
struct BodyEnv {
  Index bodies, contacts, kept;
  const Real *inv_mass, *inv_inertia, *twist, *twist_change;
  const std::uint8_t* kinematic;
  const Real *arm_a, *arm_b, *normal, *mu, *depth, *restitution;
  const Real* warm_start;
  Real *impulse, *twist_out, *w;
  EnvStatus* status;
  const Index* newton_stream;  ///< null without Newton's method
  const Index *contact_order, *sides, *vertex_offsets, *color_offsets, *body_offsets, *body_contacts;
  Index color_count;
  Index block_visits;  ///< of the contacts of a vertex before a sweep goes on

  /// Side 2 p is a of the contact at position p, side 2 p + 1 its b.
  [[nodiscard]] STICTION_HD Index side(Offset side_index) const { return sides[side_index]; }
  [[nodiscard]] STICTION_HD bool is_kinematic(Index body) const { return kinematic != nullptr && kinematic[body] != 0; }
};

/// Returns true if a side of a contact is pushed, and its motion kept.
STICTION_HD bool is_pushed(Index side) {
  return side >= 0;
}
STICTION_HD Index slot_of(Index side) {
  return side >= 0 ? side : ~side;
}

/// Environment `env` of a job.
template <class Real>
STICTION_HD BodyEnv<Real> slice_bodies(const BodyJob<Real>& job, Offset env) {
  const BodyBatchView<Real>& batch = job.batch;
  const BodyPlanView& plan = job.plan;
  const BodySolutionView<Real>& out = job.solution;
  const Offset body = batch.env_body_offsets[env];
  const Offset contact = batch.env_contact_offsets[env];
  BodyEnv<Real> v;
  v.bodies = static_cast<Index>(batch.env_body_offsets[env + 1] - body);
  v.contacts = static_cast<Index>(batch.env_contact_offsets[env + 1] - contact);
  v.kept = plan.kept[env];
  v.inv_mass = batch.inv_mass + body;
  v.inv_inertia = batch.inv_inertia + 6 * body;
  v.twist = batch.twist + 6 * body;
  v.twist_change = batch.twist_change == nullptr ? nullptr : batch.twist_change + 6 * body;
  v.kinematic = batch.kinematic == nullptr ? nullptr : batch.kinematic + body;
  v.arm_a = batch.arm_a + 3 * contact;
  v.arm_b = batch.arm_b + 3 * contact;
  v.normal = batch.normal + 3 * contact;
  v.mu = batch.mu + contact;
  v.depth = batch.depth + contact;
  v.restitution = batch.restitution + contact;
  v.warm_start = job.warm_start == nullptr ? nullptr : job.warm_start + 3 * contact;
  v.impulse = out.impulse + 3 * contact;
  v.twist_out = out.twist + 6 * body;
  v.w = out.w == nullptr ? nullptr : out.w + 3 * contact;
  v.status = out.status + env;
  v.newton_stream = plan.newton_stream == nullptr ? nullptr : plan.newton_stream + plan.newton_offsets[env];
  v.contact_order = plan.contact_order + contact;
  v.sides = plan.sides + 2 * contact;
  v.vertex_offsets = plan.vertex_offsets + contact + env;
  v.color_offsets = plan.color_offsets + contact + env;
  v.body_offsets = plan.body_offsets + body + env;
  v.body_contacts = plan.body_contacts + 2 * contact;
  v.color_count = plan.color_count[env];
  v.block_visits = job.options.blocks == BlockMode::cones ? 1 : kBlockVisits;
  return v;
}

}  // namespace stiction::inline STICTION_ISA
