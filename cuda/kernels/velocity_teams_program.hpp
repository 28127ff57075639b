#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/velocity/evaluate/velocity_result.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "core/base/extents.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// Arguments of teams of Newton's method in velocities.
template <class Real>
struct VelocityTeamArgs {
  VelocityJob<Real> job;
  JacobianArrays<Real> arrays;
  Offset room;  ///< of a team's fast memory [bytes]
};

/// Fast memory of a team that may get any environment of up to so many rows and degrees of freedom [bytes].
template <class Types>
std::size_t most_team_bytes(Index env_rows, Index env_dofs, Index lanes) {
  const Index rows = smaller_of(env_rows, kMostVelocityRows), dofs = smaller_of(env_dofs, kMostVelocityDofs);
  const Offset doubles = VelocityWorkspace<Types>::doubles(SlotCounts::most(rows, Offset{rows} * dofs), dofs,
                                                           dofs * (dofs + 1) / 2, Offset{lanes} * dofs);
  return in_shared(static_cast<std::size_t>(PackLists<1, DofSet>::bytes(rows))) +
         in_shared(static_cast<std::size_t>(doubles) * sizeof(double));
}

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Lists and numbers of a team's environment, in its fast memory.
template <class Types>
struct TeamMemory {
  using Set = typename Types::Set;
  using Lists = PackLists<1, Set>;
  using Workspace = VelocityWorkspace<Types>;
  typename Types::Team& own_team;
  unsigned char* shared;
  Offset room;
  bool& fits;  ///< out: whether the environment had room

  [[nodiscard]] STICTION_HD typename Types::Team& team() const { return own_team; }
  [[nodiscard]] STICTION_HD void* lists(Offset) const { return shared; }
  [[nodiscard]] STICTION_HD bool has_room(const Lists& lists, const SlotCounts& counts) const {
    const Offset doubles = Workspace::doubles(counts, lists.tree->dofs, lists.tree->entries, by_depth(lists));
    fits = begin(lists) + static_cast<Offset>(sizeof(double)) * doubles <= room;
    return fits;
  }
  [[nodiscard]] STICTION_HD Workspace numbers(const Lists& lists, const SlotCounts& counts) const {
    Workspace workspace(reinterpret_cast<double*>(shared + begin(lists)), counts, lists.tree->dofs, lists.tree->entries,
                        0, by_depth(lists));
    workspace.lanes = &own_team;
    return workspace;
  }

 private:
  [[nodiscard]] STICTION_HD Offset by_depth(const Lists& lists) const {
    return Offset{own_team.size()} * lists.tree->levels;
  }
  /// First byte of the numbers, behind the lists.
  [[nodiscard]] STICTION_HD Offset begin(const Lists& lists) const {
    return (static_cast<Offset>(reinterpret_cast<const unsigned char*>(lists.end()) - shared) + 15) / 16 * 16;
  }
};

/// A team for each environment of up to kMostVelocityDofs, before anything is assembled, in fast memory. An environment
/// that does not fit is left as it is. `Number`: in which steps are taken. With the batch's own, environments that ask
/// for double are taken if a kernel before has left them.
template <class Real, class Number>
struct SolveVelocityTeams {
  using Args = cuda::VelocityTeamArgs<Real>;
  static constexpr bool kSerial = false;
  static constexpr bool kInWarp = true;
  static constexpr int kThreads = cuda::kTeamThreads;
  static constexpr bool kInDouble = sizeof(Number) > sizeof(Real);
  static constexpr std::uint8_t kMark = kInDouble ? kTriedInDouble : kTried;

  /// Returns true if this kernel is to try an environment, and no launch before has.
  static STICTION_HD bool takes(const Args& args, Offset env, const LaneEnv<Real>& whole) {
    const VelocityJob<Real>& job = args.job;
    if ((args.arrays.flags[env] & kNotAssembled) != 0 || whole.dofs > kMostVelocityDofs) return false;
    if ((job.answered[env] & (kAnswered | kMark)) != 0) return false;
    const bool in_double = steps_in_double(job, env);
    if (kInDouble ? !in_double : (in_double && !is_tried_again(whole))) return false;
    return PackLists<1, DofSet>::bytes(whole.cones) <= args.room && takes_form(job.batch, env) &&
           takes_size(job.batch, whole, job.law);
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    using Types = LaneTypes<Number, 1, DofSet, Real, TeamT>;
    const VelocityJob<Real>& job = args.job;
    for (Offset env = id.index; env < job.batch.env_count; env += id.count) {
      LaneEnv<Real> whole = lane_env(job.batch, env);
      const bool is_taken = takes(args, env, whole);
      team.sync();  // all have looked before one writes
      if (!is_taken) continue;
      VelocityResult result;
      whole.result = &result;
      bool fits = true;
      solve_pack<Types>(job, &whole, 1,
                        TeamMemory<Types>{team, static_cast<unsigned char*>(id.shared), args.room, fits});
      if (fits)
        single(team, [&] {
          const std::uint8_t before = job.answered[env];
          finish(job, env, result);
          if (!result.is_answered) job.answered[env] = static_cast<std::uint8_t>(before | kMark);
          leave_out_answered(args.arrays, env);
        });
      team.sync();
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
