// Sequential impulses on one heap of spheres, single precision: costs of a sweep and the residual after 50 of them, by
// contacts, momentum and threads.
//
//   bench_bodies [--contacts 1000,10000,100000,1000000] [--threads 1,2] [--repeats 3] [--csv PATH]
//
// A sweep's time is the difference of two calls, 50 sweeps and 18. Loading, the final judgement and the output are
// hence not in it, and two in 32 recomputations of the twists are. One thread is measured in CPU time, several by the
// wall clock, the least of the repeats each.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "bench/support/arguments.hpp"
#include "bench/support/contact_batch.hpp"
#include "bench/support/csv.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"
#include "scenes/body_scenes.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

constexpr Index kShort = 18;
constexpr Index kLong = 50;
constexpr Law kLaw = Law::coulomb;

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Measured {
  double call = 0;  ///< least seconds of a call
  double residual = 0;
  std::string hash;
};

/// The least time of some calls of so many sweeps.
Measured measure(const BodyPlan& plan, const BodyBatchView<float>& view, Index sweeps, bool momentum, int threads,
                 int repeats) {
  BodySolverOptions options;
  options.law = kLaw;
  options.iterations = sweeps;
  options.momentum = momentum;
  options.threads = threads;
  options.invalid = InvalidPolicy::isolate;
  const BodySolver solver(Device::cpu(), {}, options);
  std::vector<float> impulse(static_cast<std::size_t>(3 * view.contact_count));
  std::vector<float> twist(static_cast<std::size_t>(6 * view.body_count));
  std::vector<EnvStatus> status(static_cast<std::size_t>(view.env_count));
  Measured best;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    const double start = threads == 1 ? cpu_seconds() : wall_seconds();
    solver.solve(plan, view, {impulse.data(), twist.data(), nullptr, status.data()});
    const double seconds = (threads == 1 ? cpu_seconds() : wall_seconds()) - start;
    if (repeat == 0 || seconds < best.call) best.call = seconds;
  }
  best.residual = status.front().residual;
  best.hash = hash_text(impulse);
  return best;
}

void run_scene(Index wanted, const std::vector<int>& thread_counts, int repeats, Csv* csv) {
  BodyBatch<float> batch;
  batch.add(scenes::rounded(scenes::make_body_pile(1, wanted)));
  const BodyBatchView<float> view = batch.view();
  const double start = cpu_seconds();
  const BodyPlan plan = BodySolver(Device::cpu(), {}, {}).plan(view);
  const double plan_seconds = cpu_seconds() - start;
  const Index colors = plan.color_count(0);
  for (const bool momentum : {false, true})
    for (const int threads : thread_counts) {
      const std::string method = momentum ? "si momentum" : "si";
      const Measured brief = measure(plan, view, kShort, momentum, threads, repeats);
      const Measured full = measure(plan, view, kLong, momentum, threads, repeats);
      const double sweep = (full.call - brief.call) / (kLong - kShort);
      const double per_contact = 1e9 * sweep / static_cast<double>(view.contact_count);
      const Offset bytes = contact_bytes<float>(kLaw, momentum);
      std::printf("%9lld %9lld %7d  %-12s %3d %12.3e %10.1f %7lld %12.3e %9.3f %9.3f  %s\n",
                  static_cast<long long>(view.contact_count), static_cast<long long>(view.body_count), colors,
                  method.c_str(), threads, sweep, per_contact, static_cast<long long>(bytes), full.residual, full.call,
                  plan_seconds, full.hash.c_str());
      std::fflush(stdout);
      if (csv != nullptr)
        csv->row({std::to_string(view.contact_count), std::to_string(view.body_count), std::to_string(colors), method,
                  std::to_string(threads), threads == 1 ? "cpu" : "wall", number(sweep), number(per_contact),
                  std::to_string(bytes), number(full.residual), number(full.call), number(plan_seconds), full.hash});
    }
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--contacts", "1000,10000,100000,1000000"}, {"--threads", "1,2"}, {"--repeats", "3"}});
  const auto csv = arguments.csv(
      "contacts,bodies,colors,method,threads,clock,seconds_sweep,ns_contact_sweep,"
      "bytes_contact,residual_50,seconds_50,seconds_plan,hash_50");
  for (const auto& [name, value] : describe_machine()) std::printf("# %s: %s\n", name.c_str(), value.c_str());
  std::printf("%9s %9s %7s  %-12s %3s %12s %10s %7s %12s %9s %9s  %s\n", "contacts", "bodies", "colours", "method",
              "thr", "s/sweep", "ns/contact", "bytes", "residual 50", "call [s]", "plan [s]", "hash at 50");
  for (const Index contacts : arguments.counts("--contacts"))
    run_scene(contacts, arguments.counts("--threads"), arguments.count("--repeats"), csv.get());
  return 0;
}

}  // namespace stiction::bench
