// Gain from solving the islands of one large environment apart. Many independent systems in one environment are solved
// with IslandMode::together and with IslandMode::apart. Wall clock, for it is about threads.
//
//   bench_islands [--scene stack] [--islands 200] [--sizes 6] [--seed 7] [--solver npgs] [--tolerance 1e-3]
//                 [--threads 1,2] [--repeats 7] [--csv PATH]

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "bench/support/arguments.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"
#include "scenes/merge.hpp"
#include "scenes/scenes.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

using Clock = std::chrono::steady_clock;

/// Systems of sizes 1, 2, ..., `sizes`, 1, ... in one environment.
ContactBatch<double> one_environment(const std::string& scene, int systems, int sizes, std::uint64_t seed) {
  std::vector<Environment<double>> parts;
  for (int i = 0; i < systems; ++i)
    parts.push_back(scenes::make(scene, seed, static_cast<std::uint64_t>(i), 1 + i % sizes).system);
  ContactBatch<double> batch(Law::coulomb);
  batch.add(scenes::merge(parts, seed).system);
  return batch;
}

struct Timing {
  double total = 0, split = 0, plan = 0;  ///< of the solve; of it, taking apart and joining, and planning [ms]
  EnvStatus status{};
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

Timing time_solve(const ContactBatch<double>& batch, SolverOptions options, int repeats) {
  std::vector<double> lambda(static_cast<std::size_t>(batch.row_count())), total, split, plan;
  Timing timing;
  for (int repeat = 0; repeat <= repeats; ++repeat) {
    Tracer tracer;
    options.tracer = &tracer;
    const Solver solver(Device::cpu(), options);
    const Plan made = solver.plan(batch.view());
    const double planned = tracer.now();
    const auto start = Clock::now();
    solver.solve(made, batch.view(), SolutionView<double>{lambda.data(), nullptr, &timing.status});
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    if (repeat == 0) continue;  // warms up
    const auto spent = [&](const std::string& name) {
      double sum = 0;
      for (const Span& span : tracer.spans())
        if (span.name == name && span.start >= planned) sum += span.duration;
      return sum / 1e3;
    };
    total.push_back(1e3 * seconds);
    split.push_back(spent("split") + spent("join"));
    plan.push_back(spent("plan"));
  }
  timing.total = median(total);
  timing.split = median(split);
  timing.plan = median(plan);
  return timing;
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--scene", "stack"},
                             {"--islands", "200"},
                             {"--sizes", "6"},
                             {"--seed", "7"},
                             {"--solver", "npgs"},
                             {"--tolerance", "1e-3"},
                             {"--threads", "1,2"},
                             {"--repeats", "7"}});
  const std::string& scene = arguments.text("--scene");
  const int islands = arguments.count("--islands"), sizes = arguments.count("--sizes");
  const int repeats = arguments.count("--repeats");
  const auto batch = one_environment(scene, islands, sizes, static_cast<std::uint64_t>(arguments.count("--seed", 0)));
  SolverOptions options;
  options.solver = solver_from_string(arguments.text("--solver"));
  options.tolerance = arguments.number("--tolerance");
  options.max_iterations = 20000;
  const auto csv = arguments.csv(
      "scene,systems,rows,solver,tolerance,islands,threads,solve_ms,split_ms,plan_ms,"
      "iterations,residual,code");
  std::printf("%d systems of %s, %lld rows, %s, tolerance %g\n", islands, scene.c_str(),
              static_cast<long long>(batch.row_count()), to_string(options.solver), options.tolerance);
  std::printf("%-9s %7s %10s %10s %10s %10s %10s  %s\n", "islands", "threads", "solve ms", "split ms", "plan ms",
              "iterations", "residual", "ended");
  for (const std::string& threads : arguments.texts("--threads"))
    for (const IslandMode mode : {IslandMode::together, IslandMode::apart}) {
      options.threads = to_count("--threads", threads, 0);
      options.islands = mode;
      const Timing timing = time_solve(batch, options, repeats);
      std::printf("%-9s %7s %10.1f %10.1f %10.1f %10d %10.1e  %s\n", to_string(mode), threads.c_str(), timing.total,
                  timing.split, timing.plan, timing.status.iterations, timing.status.residual,
                  to_string(timing.status.code));
      std::fflush(stdout);
      if (csv)
        csv->row({scene, std::to_string(islands), std::to_string(batch.row_count()), to_string(options.solver),
                  number(options.tolerance), to_string(mode), threads, number(timing.total), number(timing.split),
                  number(timing.plan), std::to_string(timing.status.iterations), number(timing.status.residual),
                  to_string(timing.status.code)});
    }
  return 0;
}

}  // namespace stiction::bench
