#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// Arguments of making a contact batch, or velocities, beside the job.
template <class Real>
struct JacobianArgs {
  JacobianBatchJob<Real> job;
  Real* scratch;  ///< of each team that runs, or null: it is in fast memory            (teams * slot)
  Offset slot;    ///< numbers of it for one team
  Offset* left;   ///< not 0: Newton's method in velocities has left environments; null: it is not called       (1)
  bool is_after_newton;  ///< that is to be found
};

}  // namespace stiction::cuda

/// The Jacobian form on a device: three programs make the contact batch, one moves the velocities.
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD Real* scratch_of(const cuda::JacobianArgs<Real>& args, const cuda::TeamId& id) {
  return args.scratch != nullptr ? args.scratch + id.index * args.slot : static_cast<Real*>(id.shared);
}

/// Counts the memory of each environment; a team takes one at a time. After Newton's method in velocities it finds out
/// if that has left any; a lane takes one at a time.
template <class Real>
struct CountJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    if (args.is_after_newton) {
      find_left(team, id, args);
      return;
    }
    if (args.left != nullptr && id.index == 0 && team.rank() == 0) *args.left = 0;
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count) count_env(team, args.job, env);
  }

 private:
  template <Team TeamT>
  static STICTION_HD void find_left(TeamT& team, const cuda::TeamId& id, const Args& args) {
    std::uint32_t found = 0;
    for (Offset env = id.index * team.size() + team.rank(); env < args.job.batch.env_count;
         env += id.count * team.size())
      found |= is_answered(args.job.to, env) ? 0U : 1U;
    if (team.combine(found) != 0) team.fetch(args.left);
  }
};

/// Writes the beginning of each. One team's work.
template <class Real>
struct PlaceJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    if (id.index == 0) scan_envs(team, args.job);
  }
};

/// Rows, A or Y, and b.
template <class Real>
struct WriteJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count)
      write_env(team, args.job, env, scratch_of(args, id));
  }
};

template <class Real>
struct MoveJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count)
      move_env(team, args.job, env, scratch_of(args, id));
  }
};

}  // namespace stiction::inline STICTION_ISA
