#include "bench/support/naive_pgs.hpp"

namespace stiction::bench::STICTION_VARIANT {

void naive_f32(const BaselineTask<float>& task, int sweeps) {
  naive(task, sweeps);
}
void naive_f64(const BaselineTask<double>& task, int sweeps) {
  naive(task, sweeps);
}
void naive_csr_f32(const BaselineTask<float>& task, int sweeps) {
  naive_csr(task, sweeps);
}
void naive_csr_f64(const BaselineTask<double>& task, int sweeps) {
  naive_csr(task, sweeps);
}

}  // namespace stiction::bench::STICTION_VARIANT
