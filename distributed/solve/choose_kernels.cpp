#include "distributed/solve/kernels.hpp"

namespace stiction {

inline namespace isa_ranks_baseline {
distributed::RankKernels<float> rank_kernels_f32(Law law);
distributed::RankKernels<double> rank_kernels_f64(Law law);
}  // namespace isa_ranks_baseline

#if defined(STICTION_HAS_AVX2)
namespace isa_ranks_avx2 {
distributed::RankKernels<float> rank_kernels_f32(Law law);
distributed::RankKernels<double> rank_kernels_f64(Law law);
}  // namespace isa_ranks_avx2
#endif

namespace distributed {

namespace {

#if defined(STICTION_HAS_AVX2)
bool has_avx2() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}
#endif

}  // namespace

template <>
RankKernels<float> rank_kernels(Law law) {
#if defined(STICTION_HAS_AVX2)
  if (has_avx2()) return isa_ranks_avx2::rank_kernels_f32(law);
#endif
  return isa_ranks_baseline::rank_kernels_f32(law);
}

template <>
RankKernels<double> rank_kernels(Law law) {
#if defined(STICTION_HAS_AVX2)
  if (has_avx2()) return isa_ranks_avx2::rank_kernels_f64(law);
#endif
  return isa_ranks_baseline::rank_kernels_f64(law);
}

}  // namespace distributed

}  // namespace stiction
