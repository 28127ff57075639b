#pragma once

#include "core/algorithm/warm_start/warm_start.hpp"
#include "cuda/device/kernel.hpp"

/// The warm-start store on a device: a team takes an environment at a time.
namespace stiction::inline STICTION_ISA {

template <class Real>
struct RecallEnvironments {
  using Args = RecallJob<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.batch.env_count; env += id.count) recall_env(team, job, env);
  }
};

template <class Real>
struct RememberEnvironments {
  using Args = RememberJob<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.memory.env_capacity; env += id.count) remember_env(team, job, env);
  }
};

template <class Real>
struct ForgetEnvironments {
  using Args = ForgetJob<Real>;
  static constexpr bool kSerial = true;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.memory.env_capacity; env += id.count) forget_masked(team, job, env);
  }
};

}  // namespace stiction::inline STICTION_ISA
