#pragma once

#include <limits>

#include "core/algorithm/jacobian/delassus.hpp"
#include "core/team/scan.hpp"

/// A contact batch from a Jacobian batch whose integers were never checked: environments are counted, placed one after
/// another, and written. The totals and which arrays are null are believed, nothing in the arrays is.
namespace stiction::inline STICTION_ISA {

/// Flags of an environment that gets neither A nor Y.
inline constexpr std::uint32_t kNotAssembled = kFlagOverCapacity | kFlagBadStructure;

/// Limit of an environment's rows, columns and entries.
inline constexpr Offset kMostInUse = std::numeric_limits<Index>::max();

/// Returns how much is in use of part `at` of `total` things; -1 if the offsets or the count make no sense.
STICTION_HD Offset used_part(const Offset* offsets, const Index* counts, Offset at, Offset total) {
  const Offset begin = offsets[at], end = offsets[at + 1];
  if (begin < 0 || begin > end || end > total || end - begin > kMostInUse) return -1;
  if (counts == nullptr) return end - begin;
  return counts[at] <= end - begin ? counts[at] : -1;
}

/// Rows and degrees of freedom of one environment, -1 where they are unknown.
struct JacobianExtent {
  Offset rows;
  Offset dofs;
};

template <class Real>
STICTION_HD JacobianExtent extent_of(const JacobianBatchView<Real>& batch, Offset env) {
  const Offset rows = used_part(batch.env_row_offsets, batch.env_row_counts, env, batch.row_count);
  return {rows < 0 ? -1 : rows, used_part(batch.env_dof_offsets, nullptr, env, batch.dof_count)};
}

/// Returns true if M and J of an environment lie within the batch's arrays, and J names its degrees of freedom only.
/// The answer is on every lane.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE bool jacobian_is_sound(TeamT& team, const JacobianBatchView<Real>& batch, Offset env,
                                           const JacobianExtent& extent) {
  if (extent.rows < 0 || extent.dofs < 0) return false;
  const Offset mass_rows = mass_block(batch, static_cast<Index>(extent.dofs));
  const Offset mass = used_part(batch.env_mass_offsets, nullptr, env, batch.mass_count);
  if (extent.dofs % mass_rows != 0 || mass < extent.dofs * mass_rows) return false;
  const Offset first = batch.env_row_offsets[env];
  std::uint32_t broken = 0;
  for_each(team, static_cast<Index>(extent.rows), [&](Index i) {
    const Offset count = used_part(batch.row_offsets, nullptr, first + i, batch.entry_count);
    bool sound = count >= (batch.column == nullptr ? extent.dofs : 0);
    for (Offset k = 0; batch.column != nullptr && k < count; ++k) {
      const Index column = batch.column[batch.row_offsets[first + i] + k];
      sound = sound && column >= 0 && column < extent.dofs;
    }
    broken |= static_cast<std::uint32_t>(!sound);
  });
  return team.combine(broken) == 0;
}

/// Flags of an environment and the entries of its A and of its Y.
template <Team TeamT, class Real>
STICTION_HD void count_env(TeamT& team, const JacobianBatchJob<Real>& job, Offset env) {
  const JacobianArrays<Real>& to = job.to;
  const JacobianExtent extent = extent_of(job.batch, env);
  const bool sound = jacobian_is_sound(team, job.batch, env, extent);
  const bool fits = extent.rows <= to.env_rows && extent.dofs <= to.env_dofs;
  single(team, [&] {
    std::uint32_t flags = job.batch.env_flags == nullptr ? 0U : job.batch.env_flags[env];
    if (!sound)
      flags |= kFlagBadStructure;
    else if (!fits)
      flags |= kFlagOverCapacity;
    const bool assembled = (flags & kNotAssembled) == 0;
    const bool as_factor = keeps_factor(to.use, extent.rows, extent.dofs);
    to.flags[env] = flags;
    to.matrix[env] = assembled && !as_factor ? extent.rows * extent.rows : 0;
    to.factor[env] = assembled && as_factor ? extent.rows * extent.dofs : 0;
    if (to.answered == nullptr) return;
    to.answered[env] = 0;
    to.env_row_counts[env] = job.batch.env_rows(env);
    to.env_cone_counts[env] = job.batch.env_cones(env);
  });
}

/// Returns true if an environment has its answer, so that nothing is assembled of it.
template <class Real>
STICTION_HD bool is_answered(const JacobianArrays<Real>& arrays, Offset env) {
  return arrays.answered != nullptr && (arrays.answered[env] & kAnswered) != 0;
}

/// Runs after Newton's method in velocities: an answered environment takes no room and has no rows.
template <class Real>
STICTION_HD void leave_out_answered(const JacobianArrays<Real>& arrays, Offset env) {
  if (!is_answered(arrays, env)) return;
  arrays.matrix[env] = 0;
  arrays.factor[env] = 0;
  arrays.env_row_counts[env] = 0;
  arrays.env_cone_counts[env] = 0;
}

/// Writes the first entry of every environment, from how many each has. An environment that ends beyond the room gets
/// none, nor does any behind it.
template <Team TeamT>
STICTION_HD void scan_entries(TeamT& team, Offset* entries, Index envs, Offset room, std::uint32_t* flags,
                              Offset* parts) {
  const Offset total = exclusive_scan(team, entries, envs, parts);
  single(team, [&] { entries[envs] = total; });
  if (total <= room) return;
  const Offset last = team.broadcast([&] {
    Index below = 0, above = envs;  // the last place within the room is in [below, above)
    while (above - below > 1) {
      const Index middle = below + (above - below) / 2;
      (entries[middle] <= room ? below : above) = middle;
    }
    return entries[below];
  });
  for_each(team, envs, [&](Index env) {
    if (entries[env + 1] > entries[env] && entries[env + 1] > room) flags[env] |= kFlagOverCapacity;
  });
  for_each(team, envs + 1, [&](Index env) {
    if (entries[env] > last) entries[env] = last;
  });
}

/// Computes the places of all environments, and the end of each one's rows in the contact batch. This is where the
/// next one with rows begins, whose offset may be broken. One team's work.
template <Team TeamT, class Real>
STICTION_HD void scan_envs(TeamT& team, const JacobianBatchJob<Real>& job) {
  const JacobianBatchView<Real>& batch = job.batch;
  const JacobianArrays<Real>& to = job.to;
  const auto envs = static_cast<Index>(batch.env_count);
  scan_entries(team, to.matrix, envs, to.matrix_room, to.flags, to.parts);
  scan_entries(team, to.factor, envs, to.factor_room, to.flags, to.parts);
  for_each(team, envs, [&](Index env) {
    if (used_part(batch.env_row_offsets, nullptr, env, batch.row_count) > 0)
      to.row_offsets[batch.env_row_offsets[env + 1]] = to.matrix[env + 1];
  });
  single(team, [&] {
    // Without counts the rows end where the last environment does, and the totals are the room of the arrays.
    const Offset end = batch.env_row_offsets[envs];
    const bool ends_early = batch.env_row_counts == nullptr && end >= 0 && end < batch.row_count;
    to.row_offsets[0] = 0;
    to.row_offsets[ends_early ? end : batch.row_count] = to.matrix[envs];
  });
}

/// Writes the offsets of an environment's rows, and b of rows that are not assembled.
template <Team TeamT, class Real>
STICTION_HD void write_rows(TeamT& team, const JacobianBatchJob<Real>& job, Offset env) {
  const JacobianArrays<Real>& to = job.to;
  const Offset first = job.batch.env_row_offsets[env];
  const Offset room = used_part(job.batch.env_row_offsets, nullptr, env, job.batch.row_count);
  const Offset rows = extent_of(job.batch, env).rows;
  const bool stored = to.matrix[env + 1] > to.matrix[env];
  const bool assembled = (to.flags[env] & kNotAssembled) == 0;
  for_each(team, static_cast<Index>(room), [&](Index i) {
    const bool in_use = i < rows;
    to.row_offsets[first + i] = to.matrix[env] + (stored ? (in_use ? i : rows) * rows : 0);
    to.row_counts[first + i] = stored && in_use ? static_cast<Index>(rows) : 0;
    if (in_use && !assembled) to.b[first + i] = 0;
  });
}

/// One environment of the contact batch; `scratch` has room for jacobian_elements() of the largest that is assembled.
template <Team TeamT, class Real>
STICTION_HD void write_env(TeamT& team, const JacobianBatchJob<Real>& job, Offset env, Real* scratch) {
  const bool assembled = (job.to.flags[env] & kNotAssembled) == 0;
  // Every lane has seen the flags before one of them adds to them.
  team.sync();
  write_rows(team, job, env);
  if (assembled && !is_answered(job.to, env)) assemble_env<RowTile<Real>>(team, job.job(), env, scratch);
}

/// The velocity of one environment, if its place is known. One that had its answer before gets its status back.
template <Team TeamT, class Real>
STICTION_HD void move_env(TeamT& team, const JacobianBatchJob<Real>& job, Offset env, Real* scratch) {
  if (is_answered(job.to, env)) {
    single(team, [&] { job.status[env] = job.to.status[env]; });
    return;
  }
  const JacobianExtent extent = extent_of(job.batch, env);
  if (job.velocity == nullptr || extent.rows < 0 || extent.dofs < 0 || (job.status[env].flags & kFlagBadStructure) != 0)
    return;
  velocity_env<RowTile<Real>>(team, job.job(), env, scratch);
}

}  // namespace stiction::inline STICTION_ISA
