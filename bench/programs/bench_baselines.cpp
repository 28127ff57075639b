// The same batches and sweeps as bench_solvers by the loops one would write oneself. Names:
// BASELINE/FLAGS/PRECISION/FAMILY/contacts:C/envs:E. The flags are those of the baseline's own file.

#include <benchmark/benchmark.h>

#include <algorithm>

#include "bench/support/baselines.hpp"
#include "bench/support/csv_reporter.hpp"
#include "bench/support/grid.hpp"

namespace stiction::bench {

namespace {

template <class Real>
void sweep_batch(benchmark::State& state, Baseline<Real> baseline, const std::string& family, Index contacts,
                 Offset envs) {
  const ContactBatch<Real>& batch = cached_contacts<Real>(family, contacts, envs);
  std::vector<Real> lambda;
  for (auto _ : state) {
    run_baseline(baseline, batch, kSweeps, lambda);
    benchmark::ClobberMemory();
  }
  show(state, {contacts, envs, kSweeps, worst_residual(batch, lambda), hash_text(lambda)});
}

template <class Real>
void add(const BaselineInfo& info, Baseline<Real> baseline, const std::string& family, Index contacts, Offset envs) {
  std::string flags = info.flags;
  std::replace(flags.begin(), flags.end(), ' ', '_');
  const std::string name = info.name + "/" + flags + "/" + precision_name<Real>() + "/" + family +
                           "/contacts:" + std::to_string(contacts) + "/envs:" + std::to_string(envs);
  benchmark::RegisterBenchmark(
      name.c_str(), [=](benchmark::State& state) { sweep_batch<Real>(state, baseline, family, contacts, envs); });
}

/// A baseline takes environments one by one, so their number changes nothing but how much memory is walked. One size
/// of batch is enough for each number of contacts.
void register_all() {
  constexpr Offset kBaselineEnvs = 256;
  for (const Index contacts : kContacts) {
    const Offset envs = capped_envs(contacts, kBaselineEnvs, kEntries);
    for (const BaselineInfo& info : baselines()) add(info, info.f32, "stack", contacts, envs);
    for (const BaselineInfo& info : baselines()) add(info, info.f64, "stack", contacts, envs);
  }
}

}  // namespace

}  // namespace stiction::bench

int main(int argc, char** argv) {
  stiction::bench::register_all();
  return stiction::bench::run_benchmarks(argc, argv);
}
