#include "bench/support/baselines.hpp"

namespace stiction::bench {

#if defined(STICTION_BENCH_HAS_EIGEN)
#define STICTION_EIGEN(variant, flags)                     \
  , {                                                      \
    "eigen", flags, variant::eigen_f32, variant::eigen_f64 \
  }
#else
#define STICTION_EIGEN(variant, flags)
#endif
#define STICTION_DECLARE(variant)                       \
  namespace variant {                                   \
  void naive_f32(const BaselineTask<float>&, int);      \
  void naive_f64(const BaselineTask<double>&, int);     \
  void naive_csr_f32(const BaselineTask<float>&, int);  \
  void naive_csr_f64(const BaselineTask<double>&, int); \
  void eigen_f32(const BaselineTask<float>&, int);      \
  void eigen_f64(const BaselineTask<double>&, int);     \
  }
#define STICTION_ENTRIES(variant, flags)                    \
  {"naive", flags, variant::naive_f32, variant::naive_f64}, \
      {"naive_csr", flags, variant::naive_csr_f32, variant::naive_csr_f64} STICTION_EIGEN(variant, flags)

STICTION_DECLARE(portable)
STICTION_DECLARE(native)
STICTION_DECLARE(native_fast)

const std::vector<BaselineInfo>& baselines() {
  static const std::vector<BaselineInfo> all{STICTION_ENTRIES(portable, "-O3"),
                                             STICTION_ENTRIES(native, "-O3 -march=native"),
                                             STICTION_ENTRIES(native_fast, "-O3 -march=native -ffast-math")};
  return all;
}

template <class Real>
void run_baseline(Baseline<Real> baseline, const ContactBatch<Real>& batch, int sweeps, std::vector<Real>& lambda) {
  const ContactBatchView<Real> view = batch.view();
  lambda.resize(static_cast<std::size_t>(view.row_count));
  std::vector<Real> scratch;
  for (Offset e = 0; e < view.env_count; ++e) {
    const Offset first = view.env_row_offsets[e];
    const auto n = static_cast<Index>(view.env_row_offsets[e + 1] - first);
    const auto needed = static_cast<std::size_t>(n) * static_cast<std::size_t>(n + 4);
    if (scratch.size() < needed) scratch.resize(needed);
    baseline({n, view.row_offsets + first, view.column, view.A, view.b + first, view.R + first, view.mu + first,
              lambda.data() + first, scratch.data()},
             sweeps);
  }
}

template void run_baseline(Baseline<float>, const ContactBatch<float>&, int, std::vector<float>&);
template void run_baseline(Baseline<double>, const ContactBatch<double>&, int, std::vector<double>&);

}  // namespace stiction::bench
