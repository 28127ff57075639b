#pragma once

#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/velocity/evaluate/newton_progress.hpp"
#include "core/algorithm/velocity/load/load_pack.hpp"

namespace stiction::inline STICTION_ISA {

/// The environments of a batch, as Newton's method in velocities reads them and answers to. Robots whose numbers lie in
/// lanes already are another source (articulated/robot_source.hpp).
template <class Types>
struct BatchSource {
  using Real = typename Types::Real;
  const VelocityJob<Real>& job;
  const LaneEnv<Real> (&envs)[Types::kLanes];

  [[nodiscard]] STICTION_HD bool has(int l) const { return envs[l].env >= 0; }
  [[nodiscard]] STICTION_HD Law law() const { return job.law; }
  [[nodiscard]] STICTION_HD MassForm mass_form() const { return job.batch.mass_form; }
  [[nodiscard]] STICTION_HD Index dofs(int l) const { return envs[l].dofs; }
  /// Returns true if a sequence of problems is taken on.
  [[nodiscard]] STICTION_HD bool takes_sequence(int l) const { return pays_in_sequence(envs[l].rows, envs[l].dofs); }
  /// Returns true if it is known beforehand that no environment falls apart.
  [[nodiscard]] STICTION_HD bool is_one_island() const { return false; }
  STICTION_HD void set_limits(LaneProgress& lane, int l) const { lane.set_limits(job, envs[l].env, kMostSteps); }

  STICTION_HD void load(const VelocityWorkspace<Types>& workspace, const TreeOf<Types>& tree,
                        const SlotOf<Types>* slots, const SlotCounts& counts) const {
    const Real zeros[kTileReach<Real>] = {};
    load_motion(workspace, job.batch, tree, envs, zeros);
    workspace.each(counts.slots, [&](Index s) { load_slot(workspace, job.batch, slots[s], s, envs, zeros); });
  }

  /// M's factor, for the lanes that a DoublePack has.
  template <class Part>
  [[nodiscard]] STICTION_HD auto factor_mass(const Part& part) const {
    return part.factor_mass();
  }

  [[nodiscard]] STICTION_HD bool has_reactions() const { return job.warm_start != nullptr; }
  [[nodiscard]] STICTION_HD bool has_velocities() const { return job.warm_velocity != nullptr; }
  STICTION_HD void load_reactions(const SlotOf<Types>& slot, const typename Types::Numbers& to) const {
    load_by_row<Types, Real>(slot, envs, job.warm_start, Real(0), to);
  }
  /// A lane's velocity to start from.
  [[nodiscard]] STICTION_HD Real first_velocity(int l, Index k) const {
    return job.warm_velocity[job.batch.env_dof_offsets[envs[l].env] + dof_of(envs[l], k)];
  }

  /// Writes the answer of a lane to where the batch has it.
  STICTION_HD void write_lane(const VelocityWorkspace<Types>& workspace, const SlotOf<Types>* slots,
                              const SlotCounts& counts, int l) const {
    const LaneEnv<Real>& env = envs[l];
    workspace.each(counts.slots, [&](Index s) {
      for (Index k = 0; k < slots[s].rows && slots[s].row_of[l] >= 0; ++k) {
        const Offset to = env.first_row + slots[s].row_of[l] + k;
        const Index row = slots[s].row + k;
        job.to.lambda[to] = canonical_zero(static_cast<Real>(workspace.x.at(row, l)));
        if (job.to.w != nullptr)
          job.to.w[to] = canonical_zero(saturated<Real>(workspace.motion[Offset{row} * Types::kStride + l]));
      }
    });
    workspace.each(job.to.velocity != nullptr ? env.dofs : 0, [&](Index k) {
      job.to.velocity[job.batch.env_dof_offsets[env.env] + dof_of(env, k)] =
          canonical_zero(saturated<Real>(workspace.velocity[Offset{k} * Types::kStride + l]));
    });
  }
  /// Writes down how a lane ended.
  STICTION_HD void finish(const VelocityWorkspace<Types>&, const LaneProgress& lane, int l) const {
    if (has(l)) *envs[l].result = lane.result();
  }
};

}  // namespace stiction::inline STICTION_ISA
