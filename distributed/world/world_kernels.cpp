#include "distributed/world/world_kernels.hpp"

namespace stiction::distributed {

template <>
cpu::WorldKernels<float> world_kernels() {
  return cpu::best_isa().world_kernels().f32;
}
template <>
cpu::WorldKernels<double> world_kernels() {
  return cpu::best_isa().world_kernels().f64;
}

}  // namespace stiction::distributed
