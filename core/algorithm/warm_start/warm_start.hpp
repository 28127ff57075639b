#pragma once

#include "core/algorithm/plan/sort_network.hpp"
#include "core/job/warm_start_job.hpp"
#include "core/team/reduce.hpp"

/// Storing one environment's reactions and handing them out again (docs/howto/warm_start.md).
namespace stiction::inline STICTION_ISA {

/// Ranges of one environment's cones and rows in this step's batch.
struct WarmStartSpan {
  Offset first_cone;
  Offset first_row;
  Index cones;
  Index rows;
  bool fits;  ///< in the store's memory
};

/// Rows of a contact point of bodies.
constexpr Index kContactRows = 3;

/// Returns true if the batch's cones are contact points of bodies: it has no offsets of rows, because each has three.
STICTION_HD bool are_contacts(const BatchLayout& batch) {
  return batch.cone_row_offsets == nullptr;
}

template <class Real>
STICTION_HD WarmStartSpan warm_start_span(const BatchLayout& batch, const WarmStartMemory<Real>& memory, Offset env) {
  const Offset cone = batch.env_cone_offsets[env];
  const Index cones = batch.env_cones(env);
  const bool contacts = are_contacts(batch);
  const Offset row = contacts ? kContactRows * cone : batch.env_row_offsets[env];
  const Index rows = contacts ? kContactRows * cones : batch.env_rows(env);
  return {cone, row, cones, rows, cone + cones <= memory.cone_capacity && row + rows <= memory.row_capacity};
}

/// Writes the environment's cones to `entry`, sorted by id and, among equal ids, by their order in the batch. Returns
/// the flag of duplicate ids, on every lane.
template <Team TeamT>
STICTION_HD std::uint32_t sort_cones(TeamT& team, const BatchLayout& batch, const std::uint64_t* cone_id,
                                     const WarmStartSpan& span, WarmStartEntry* entry) {
  const bool contacts = are_contacts(batch);
  for_each(team, span.cones, [&](Index c) {
    const Offset cone = span.first_cone + c;
    if (contacts) {
      entry[c] = WarmStartEntry{cone_id[cone], kContactRows * c, ConeKind::friction, kContactRows, 0};
      return;
    }
    const Offset row = batch.cone_row_offsets[cone];
    entry[c] = WarmStartEntry{cone_id[cone], static_cast<Index>(row - span.first_row), batch.cone_kind[cone],
                              static_cast<std::uint8_t>(batch.cone_row_offsets[cone + 1] - row), 0};
  });
  sort_network(team, span.cones, entry, [](const WarmStartEntry& a, const WarmStartEntry& b) {
    return a.id < b.id || (a.id == b.id && a.row < b.row);
  });
  std::uint32_t flags = 0;
  for (Index p = team.rank() + 1; p < span.cones; p += team.size())
    flags |= entry[p].id == entry[p - 1].id ? std::uint32_t{kWarmStartDuplicateId} : 0U;
  return team.combine(flags);
}

/// Returns the factor of a stored reaction in a step of another length; 0 where that is not a finite number.
template <class Real>
STICTION_HD Real carry_factor(double beta, StepScaling scaling, double dt_before, double dt_now) {
  double ratio = 1.0;
  if (scaling == StepScaling::capped && dt_before < dt_now) ratio = div_(dt_before, dt_now);
  if (scaling == StepScaling::proportional) ratio = div_(dt_now, dt_before);
  const Real factor = static_cast<Real>(beta * ratio);
  return select(finite_(factor), factor, Real(0));
}

/// The first guess of one environment.
template <Team TeamT, class Real>
STICTION_HD void load_warm_start(TeamT& team, const WarmStartLoadJob<Real>& job, Offset env) {
  const WarmStartMemory<Real>& memory = job.memory;
  const WarmStartSpan span = warm_start_span(job.batch, memory, env);
  Real* const guess = job.guess + span.first_row;
  for_each(team, span.rows, [&](Index i) { guess[i] = Real(0); });
  if (!span.fits) {
    single(team, [&] {
      memory.record[env] = WarmStartRecord{0, span.cones, kWarmStartTooLarge, memory.record[env].too_large + 1};
    });
    return;
  }
  WarmStartEntry* const cone = memory.sorting + span.first_cone;
  const std::uint32_t flags = sort_cones(team, job.batch, job.cone_id, span, cone);
  const WarmStartSlot slot = memory.slot[env];
  const WarmStartEntry* const known = memory.stored + slot.first_cone;
  const Real* const lambda = memory.lambda + slot.first_row;
  const Real factor = carry_factor<Real>(job.beta, job.scaling, slot.dt, job.dt);
  for_each(team, span.cones, [&](Index p) {
    const bool first_of_its_id = p == 0 || cone[p - 1].id != cone[p].id;
    if (!first_of_its_id) return;
    const Index q =
        lower_bound(known, slot.cones, cone[p].id, [](const WarmStartEntry& a, std::uint64_t id) { return a.id < id; });
    if (q == slot.cones || known[q].id != cone[p].id) return;
    if (known[q].kind != cone[p].kind || known[q].rows != cone[p].rows) return;
    for (Index k = 0; k < cone[p].rows; ++k) guess[cone[p].row + k] = canonical_zero(factor * lambda[known[q].row + k]);
    cone[p].hit = 1;
  });
  const Index hits = sum_leaves<Index>(team, [&](Index leaf) {
    Index count = 0;
    for (Index p = leaf; p < span.cones; p += kReduceLeaves) count += cone[p].hit;
    return count;
  });
  single(team,
         [&] { memory.record[env] = WarmStartRecord{hits, span.cones - hits, flags, memory.record[env].too_large}; });
}

/// Returns true if an answer is worth starting from. Named one by one: a code that is not known here is not trusted.
STICTION_HD bool worth_storing(EnvCode code) {
  return code == EnvCode::solved || code == EnvCode::max_iterations || code == EnvCode::stalled ||
         code == EnvCode::rounding || code == EnvCode::infeasible;
}

/// Drops the stored reactions of one environment, and notes why.
template <Team TeamT, class Real>
STICTION_HD void reset_warm_start(TeamT& team, const WarmStartMemory<Real>& memory, Offset env, std::uint32_t flags) {
  single(team, [&] {
    memory.slot[env] = WarmStartSlot{0, 0, 1.0, 0, 0};
    memory.record[env].flags |= flags;
    if ((flags & kWarmStartTooLarge) != 0) ++memory.record[env].too_large;
  });
}

/// A reset of one environment, if the mask asks for it.
template <Team TeamT, class Real>
STICTION_HD void reset_masked(TeamT& team, const WarmStartResetJob<Real>& job, Offset env) {
  if (job.mask == nullptr || job.mask[env] != 0) reset_warm_start(team, job.memory, env, kWarmStartReset);
}

/// Stores the reactions of one environment for the next step, in the place of the last one's. Loading is over, and no
/// environment reads another's part.
template <Team TeamT, class Real>
STICTION_HD void store_warm_start(TeamT& team, const WarmStartStoreJob<Real>& job, Offset env) {
  const WarmStartMemory<Real>& memory = job.memory;
  if (env >= job.batch.env_count) {
    reset_warm_start(team, memory, env, 0);
    return;
  }
  // Nothing of an environment that failed is read: its offsets may be wrong.
  const bool failed = !worth_storing(job.status[env].code);
  const WarmStartSpan span = failed ? WarmStartSpan{0, 0, 0, 0, true} : warm_start_span(job.batch, memory, env);
  const Real* const lambda = job.lambda + span.first_row;
  std::uint32_t refused = failed ? std::uint32_t{kWarmStartFailed} : 0U;
  for (Index i = team.rank(); i < span.rows; i += team.size())
    refused |= finite_(lambda[i]) ? 0U : std::uint32_t{kWarmStartNotFinite};
  refused = team.combine(refused);
  if (!span.fits) refused |= kWarmStartTooLarge;
  if (refused != 0) {
    reset_warm_start(team, memory, env, refused);
    return;
  }
  const std::uint32_t flags = sort_cones(team, job.batch, job.cone_id, span, memory.stored + span.first_cone);
  for_each(team, span.rows, [&](Index i) { memory.lambda[span.first_row + i] = lambda[i]; });
  single(team, [&] {
    memory.slot[env] = WarmStartSlot{span.first_cone, span.first_row, job.dt, span.cones, 0};
    memory.record[env].flags |= flags;
  });
}

}  // namespace stiction::inline STICTION_ISA
