#pragma once

#include "core/algorithm/warm_start/warm_start.hpp"
#include "cuda/api/kernel.hpp"

/// The warm-start store on a device: a team takes an environment at a time.
namespace stiction::inline STICTION_ISA {

template <class Real>
struct LoadWarmStarts {
  using Args = WarmStartLoadJob<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.batch.env_count; env += id.count) load_warm_start(team, job, env);
  }
};

template <class Real>
struct StoreWarmStarts {
  using Args = WarmStartStoreJob<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.memory.env_capacity; env += id.count) store_warm_start(team, job, env);
  }
};

template <class Real>
struct ResetWarmStarts {
  using Args = WarmStartResetJob<Real>;
  static constexpr bool kSerial = true;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& job) {
    for (Offset env = id.index; env < job.memory.env_capacity; env += id.count) reset_masked(team, job, env);
  }
};

}  // namespace stiction::inline STICTION_ISA
