#include "bench/support/eigen_pgs.hpp"

namespace stiction::bench::STICTION_VARIANT {

void eigen_f32(const BaselineTask<float>& task, int sweeps) {
  eigen(task, sweeps);
}
void eigen_f64(const BaselineTask<double>& task, int sweeps) {
  eigen(task, sweeps);
}

}  // namespace stiction::bench::STICTION_VARIANT
