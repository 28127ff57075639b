#include "tools/gpu_first/target.hpp"

#include "core/job/fallback_chain.hpp"
#include "cuda/api/kernel_catalogue.hpp"

namespace stiction::gpu_first {

bool carries(const Target& target, SolverKind solver) {
  if (solver == SolverKind::automatic) {
    for (int stage = 0; stage < kFallbackStages; ++stage)
      if (!carries(target, fallback_stage(stage).solver)) return false;
    return true;
  }
  const cuda::SolverKernels& kernels = target.api()->kernels().solvers[static_cast<std::size_t>(solver)];
  return target.carries(kernels.by_precision_and_law[0][0].dense);
}

}  // namespace stiction::gpu_first
