#include "distributed/solve/kernels.hpp"
#include "distributed/solve/part_kernels.hpp"

namespace stiction {

inline namespace isa_ranks_baseline {
distributed::RankKernels<float> rank_kernels_f32(Law law);
distributed::RankKernels<double> rank_kernels_f64(Law law);
distributed::PartKernels part_kernels_of_isa();
}  // namespace isa_ranks_baseline

#if defined(STICTION_HAS_AVX2)
namespace isa_ranks_avx2 {
distributed::RankKernels<float> rank_kernels_f32(Law law);
distributed::RankKernels<double> rank_kernels_f64(Law law);
distributed::PartKernels part_kernels_of_isa();
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

PartKernels part_kernels() {
#if defined(STICTION_HAS_AVX2)
  if (has_avx2()) return isa_ranks_avx2::part_kernels_of_isa();
#endif
  return isa_ranks_baseline::part_kernels_of_isa();
}

}  // namespace distributed

}  // namespace stiction
