#include "tools/gpu_first/target.hpp"

#include "core/job/fallback_order.hpp"
#include "cuda/api/kernel_catalogue.hpp"

namespace stiction::gpu_first {

bool carries(const Target& target, SolverKind solver) {
  if (solver == SolverKind::automatic) {
    for (int turn = 0; turn < kFallbackTurns; ++turn)
      if (!carries(target, turn_solver(turn))) return false;
    return true;
  }
  const cuda::SolverKernels& kernels = target.api()->kernels().solvers[static_cast<std::size_t>(solver)];
  return target.carries(kernels.by_precision_and_law[0][0].dense);
}

}  // namespace stiction::gpu_first
