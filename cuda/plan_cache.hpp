#pragma once

#include <list>
#include <memory>

#include "core/base/plan_view.hpp"
#include "cuda/cuda_memory.hpp"
#include "cuda/cuda_stream.hpp"
#include "cuda/layout.hpp"

namespace stiction::cuda {

/// A plan and its layout in device memory.
struct DevicePlan {
  PlanView view;
  const Offset* envs = nullptr;     ///< Layout::envs
  const Offset* offsets = nullptr;  ///< Layout::offsets
  Layout layout;

  std::weak_ptr<const PlanData> owner;  ///< expired: nobody can ask for this copy again
  DeviceBuffer memory;
  Event uploaded;
};

/// The plans a solver has met, so that solving again needs no upload. Copies live and die on the cache's own stream,
/// which waits for every solve that reads them.
class PlanCache {
 public:
  PlanCache(MemoryPool& pool, const LayoutRules& rules) : pool_(&pool), rules_(rules) {}

  /// The copy of `plan`; what `stream` does from now on may read it.
  const DevicePlan& get(const PlanData& plan, cudaStream_t stream);
  /// What `stream` has been given so far reads the plans.
  void used_on(cudaStream_t stream);

 private:
  DevicePlan upload(const PlanData& plan);

  MemoryPool* pool_;
  LayoutRules rules_;
  Stream stream_;
  Event done_;
  std::list<DevicePlan> plans_;
};

}  // namespace stiction::cuda
