#pragma once

#include "core/algorithm/plan/plan_environment.hpp"
#include "core/algorithm/unrolled/unrolled_vjp.hpp"

/// Sweeps in reverse on a device. The team that takes an environment plans it, too: the host knows no structure.
namespace stiction::inline STICTION_ISA {

/// Plan of an environment, at the beginning of a team's scratch. Its arrays lie behind it: the order of the cones,
/// where vertices and where colours begin.
struct UnrolledPlan {
  ConeCounts counts;
  EnvPath path;
  Index color_count;

  /// With its arrays, in doubles.
  static STICTION_HD constexpr Offset elements(Offset cones) {
    const Offset bytes =
        static_cast<Offset>(sizeof(UnrolledPlan)) + (3 * cones + 2) * static_cast<Offset>(sizeof(Index));
    return (bytes + 7) / 8;
  }
};

/// Scratch of a team that takes environments of that size, in doubles. Memory of the plan is free again for the tape.
STICTION_HD constexpr Offset unrolled_slot(Offset rows, Offset cones, Offset sweeps, Offset entry_span) {
  const Offset tape = unrolled_elements(rows, cones, sweeps);
  const Offset planning = (plan_scratch_elements(rows, cones, entry_span) + 1) / 2;
  return UnrolledPlan::elements(cones) + (tape > planning ? tape : planning);
}

/// Plans an environment that is sound and pulls its sweeps back. One that the scratch is too small for gets zeros.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void plan_and_unroll(TeamT& team, const UnrolledJob<Real>& job, Offset index, double* scratch,
                                         Offset slot) {
  const StructureView structure = structure_of(job.batch, index);
  const bool has_room =
      structure.rows <= job.max_unknowns &&
      unrolled_slot(structure.rows, structure.cones, job.sweeps.count, structure.entry_span()) <= slot;
  if (!has_room) return refuse_unrolled(team, job, index, kGradientOverCapacity);
  auto* const plan = reinterpret_cast<UnrolledPlan*>(scratch);
  auto* const order = reinterpret_cast<Index*>(plan + 1);
  double* const tape = scratch + UnrolledPlan::elements(structure.cones);
  // Cones of a factor stay in the batch's order.
  if (job.batch.env_dofs(index) == 0) {
    const PlanTarget target{
        &plan->path,       &plan->counts, order, order + structure.cones, order + 2 * structure.cones + 1,
        &plan->color_count};
    plan_environment(team, structure, target, reinterpret_cast<Index*>(tape));
  }
  unrolled_env(team, job, index, order, tape);
}

}  // namespace stiction::inline STICTION_ISA
