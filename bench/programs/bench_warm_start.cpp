// Iterations of a recorded trajectory, step by step. Every step starts from zero, or from the step before by way of a
// WarmStartStore. Iterations, not seconds: the counts are the same on every machine.
//
//   bench_warm_start [--batch examples/data/trajectory.h5] [--tolerance 1e-3,1e-4,1e-6] [--beta 0.95,1]
//                    [--solver npgs,apgd] [--csv PATH]

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>

#include "bench/support/arguments.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"
#include "stiction/io.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

constexpr Index kMostIterations = 20000;

/// All simulations at one step.
struct Moment {
  ContactBatch<double> batch;
  std::vector<std::uint64_t> cone_id;
  double dt;
};

struct Trajectory {
  std::vector<Moment> moments;
  std::vector<std::string> names;  ///< of the simulations
  WarmStartCapacity room;
};

Trajectory load(const std::string& path) {
  const io::Recording file = io::read_batch(path);
  const auto& arrays = file.batch.arrays();
  const auto envs = static_cast<std::size_t>(file.batch.env_count());
  const auto together = static_cast<std::size_t>(
      file.step.empty() ? 0 : std::count(file.step.begin(), file.step.end(), file.step.front()));
  if (together == 0 || envs % together != 0 || file.dt.empty() || file.cone_id.empty())
    throw Error(ErrorCode::bad_file, path +
                                         ": not a trajectory: it needs step, dt and cone_id, and as many environments "
                                         "in every step (docs/reference/file_formats.md)");
  Trajectory trajectory;
  for (std::size_t first = 0; first < envs; first += together) {
    std::vector<Offset> order(together);
    for (std::size_t i = 0; i < together; ++i) order[i] = static_cast<Offset>(first + i);
    Moment moment{gather<double>(file.batch, order), {}, file.dt[first]};
    moment.cone_id.assign(file.cone_id.begin() + arrays.env_cone_offsets[first],
                          file.cone_id.begin() + arrays.env_cone_offsets[first + together]);
    trajectory.room.cones = std::max(trajectory.room.cones, static_cast<Offset>(moment.cone_id.size()));
    trajectory.room.rows = std::max(trajectory.room.rows, moment.batch.row_count());
    trajectory.moments.push_back(std::move(moment));
  }
  trajectory.room.envs = static_cast<Offset>(together);
  for (std::size_t i = 0; i < together; ++i)
    trajectory.names.push_back(file.env_name.empty() ? std::to_string(i) : file.env_name[i]);
  return trajectory;
}

/// One simulation, solved step by step.
struct Run {
  std::vector<double> iterations;  ///< of every step but the first, which has nothing to start from
  int unsolved = 0;
  Offset hits = 0, cones = 0;
};

/// Every simulation from step to step; beta 0: from zero each time.
std::vector<Run> follow(const Trajectory& trajectory, const SolverOptions& options, double beta) {
  const Solver solver(Device::cpu(), options);
  const std::size_t envs = trajectory.names.size();
  std::unique_ptr<WarmStartStore<double>> store;
  if (beta > 0) {
    WarmStartOptions warm;
    warm.beta = beta;
    store = std::make_unique<WarmStartStore<double>>(Device::cpu(), trajectory.room, warm);
  }
  std::vector<Run> runs(envs);
  std::vector<WarmStartRecord> record(envs);
  for (std::size_t step = 0; step < trajectory.moments.size(); ++step) {
    const Moment& moment = trajectory.moments[step];
    const auto view = moment.batch.view();
    std::vector<double> lambda(static_cast<std::size_t>(view.row_count)), guess(lambda.size());
    std::vector<EnvStatus> status(envs);
    const SolutionView<double> solution{lambda.data(), nullptr, status.data()};
    if (store) store->load(view, moment.cone_id.data(), moment.dt, guess.data());
    solver.solve(solver.plan(view), view, solution, store ? guess.data() : nullptr);
    if (store) store->store(view, moment.cone_id.data(), solution, moment.dt);
    if (step == 0) continue;
    if (store) store->records(record);
    for (std::size_t e = 0; e < envs; ++e) {
      runs[e].iterations.push_back(status[e].iterations);
      runs[e].unsolved += status[e].code == EnvCode::solved ? 0 : 1;
      runs[e].hits += record[e].hits;
      runs[e].cones += record[e].hits + record[e].misses;
    }
  }
  return runs;
}

/// Nearest rank: the smallest value that `percent` of them do not exceed.
double quantile(std::vector<double> values, std::size_t percent) {
  std::sort(values.begin(), values.end());
  return values[(percent * values.size() + 99) / 100 - 1];
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--batch", "examples/data/trajectory.h5"},
                             {"--tolerance", "1e-3,1e-4,1e-6"},
                             {"--beta", "0.95,1"},
                             {"--solver", "pgs,npgs,jacobi,apgd"}});
  const Trajectory trajectory = load(arguments.text("--batch"));
  if (trajectory.moments.size() < 2)
    throw Error(ErrorCode::bad_file, arguments.text("--batch") + ": one step has no step before it");
  const auto csv = arguments.csv(
      "simulation,solver,tolerance,beta,steps,known_percent,cold_median,cold_p90,cold_unsolved,"
      "warm_median,warm_p90,warm_unsolved,fewer_times");
  std::printf("%-16s %-7s %9s %5s %6s %17s %17s %10s\n", "simulation", "solver", "tolerance", "beta", "known",
              "cold median, p90", "warm median, p90", "sum: times");
  for (const std::string& name : arguments.texts("--solver")) {
    for (const double tolerance : arguments.numbers("--tolerance")) {
      SolverOptions options;
      options.solver = solver_from_string(name);
      options.tolerance = tolerance;
      options.max_iterations = kMostIterations;
      const std::vector<Run> cold = follow(trajectory, options, 0.0);
      for (const double beta : arguments.numbers("--beta")) {
        const std::vector<Run> warm = follow(trajectory, options, beta);
        for (std::size_t e = 0; e < cold.size(); ++e) {
          double all_cold = 0, all_warm = 0;
          for (const double n : cold[e].iterations) all_cold += n;
          for (const double n : warm[e].iterations) all_warm += n;
          const double known =
              100.0 * static_cast<double>(warm[e].hits) / static_cast<double>(std::max(warm[e].cones, Offset{1}));
          const double c50 = quantile(cold[e].iterations, 50), c90 = quantile(cold[e].iterations, 90);
          const double w50 = quantile(warm[e].iterations, 50), w90 = quantile(warm[e].iterations, 90);
          const double fewer = all_cold / std::max(all_warm, 1.0);
          std::printf("%-16s %-7s %9.0e %5.2f %5.1f%% %8.0f %8.0f %8.0f %8.0f %10.2f%s\n", trajectory.names[e].c_str(),
                      name.c_str(), tolerance, beta, known, c50, c90, w50, w90, fewer,
                      cold[e].unsolved + warm[e].unsolved > 0 ? "  (not all solved)" : "");
          if (csv)
            csv->row({trajectory.names[e], name, number(tolerance), number(beta),
                      std::to_string(cold[e].iterations.size()), number(known), number(c50, 6), number(c90, 6),
                      std::to_string(cold[e].unsolved), number(w50, 6), number(w90, 6),
                      std::to_string(warm[e].unsolved), number(fewer)});
        }
      }
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace stiction::bench
