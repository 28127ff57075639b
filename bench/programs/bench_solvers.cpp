// Every solver and precision at a fixed number of sweeps, over contacts and environments; one thread, and a group that
// adds threads. Names: stiction/SOLVER/PRECISION/FAMILY/contacts:C/envs:E.

#include <benchmark/benchmark.h>

#include <thread>

#include "bench/support/csv_reporter.hpp"
#include "bench/support/grid.hpp"

namespace stiction::bench {

namespace {

/// Solves the batch again and again: plan and memory once, everything that solve() does each time.
template <class Real>
void solve_batch(benchmark::State& state, SolverKind kind, const std::string& family, Index contacts, Offset envs,
                 int threads) {
  const ContactBatch<Real>& batch = cached_contacts<Real>(family, contacts, envs);
  const ContactBatchView<Real> view = batch.view();
  SolverOptions options = fixed_sweeps(kind, kSweeps);
  options.threads = threads;
  const Solver solver(Device::cpu(), options);
  const Plan plan = solver.plan(view);
  std::vector<Real> lambda(static_cast<std::size_t>(view.row_count));
  std::vector<Real> w(lambda.size());
  std::vector<EnvStatus> status(static_cast<std::size_t>(view.env_count));
  const SolutionView<Real> solution{lambda.data(), w.data(), status.data()};
  for (auto _ : state) {
    solver.solve(plan, view, solution);
    benchmark::ClobberMemory();
  }
  for (const EnvStatus& s : status)
    if (s.iterations != kSweeps) return state.SkipWithError("an environment stopped before its last sweep");
  show(state, {contacts, envs, kSweeps, worst_residual(batch, lambda), hash_text(lambda)});
}

template <class Real>
benchmark::internal::Benchmark* add(SolverKind kind, const std::string& family, Index contacts, Offset envs,
                                    const std::string& suffix, int threads) {
  const std::string name = std::string("stiction/") + to_string(kind) + "/" + precision_name<Real>() + "/" + family +
                           "/contacts:" + std::to_string(contacts) + "/envs:" + std::to_string(envs) + suffix;
  return benchmark::RegisterBenchmark(
      name.c_str(), [=](benchmark::State& state) { solve_batch<Real>(state, kind, family, contacts, envs, threads); });
}

template <class Real>
void add_solvers(const std::string& family, Index contacts, Offset envs) {
  for (const SolverKind kind : {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::apgd})
    add<Real>(kind, family, contacts, envs, "", 1);
}

void register_all() {
  for_each_grid_point([](Index contacts, Offset envs) {
    add_solvers<float>("stack", contacts, envs);
    add_solvers<double>("stack", contacts, envs);
  });
  constexpr Index kThreadContacts = 8;
  const Offset envs = capped_envs(kThreadContacts, kEnvs[4], 2 * kEntries);
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  for (int threads = 1; threads <= cores; threads *= 2)
    add<float>(SolverKind::npgs, "stack", kThreadContacts, envs, "/threads:" + std::to_string(threads), threads)
        ->UseRealTime();
}

}  // namespace

}  // namespace stiction::bench

int main(int argc, char** argv) {
  stiction::bench::register_all();
  return stiction::bench::run_benchmarks(argc, argv);
}
