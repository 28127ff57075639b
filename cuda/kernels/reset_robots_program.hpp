#pragma once

#include "core/algorithm/articulated/reset.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::inline STICTION_ISA {

/// A team resets an environment at a time.
template <class Real>
struct ResetRobots {
  using Args = ArticulatedResetJob<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.env_count; env += id.count) reset_masked(team, job, env);
  }
};

}  // namespace stiction::inline STICTION_ISA
