// What Newton's method over ranks takes (docs/math/domain_newton.md): steps, sweeps, linear iterations and messages.
// Numbers of subdomains are compared, and preconditioners of one level and two. Ranks are threads of
// this process. Counts are the same on every machine; seconds are printed and not written.
//
//   bench_domain_newton [--scene wall|pile|tower|column] [--sizes 16] [--ranks 2] [--subdomains 2,4,8,16] [--law
//   convex]
//                       [--cfm 1e-5] [--tolerances 1e-6] [--kinds neither,overlap,coarse,both,si]
//                       [--first-sweeps 48] [--limit 1000] [--csv PATH]
//
// --subdomains 0: one for each body, which without overlap and coarse space is block Jacobi. Kind si is sequential
// impulses over as many ranks, which have no subdomains. A column of size s has 60 s^3 spheres, 15 times as high as
// wide.

#include <algorithm>
#include <cstdio>

#include "bench/support/arguments.hpp"
#include "bench/support/table_main.hpp"
#include "distributed/newton/solve_by_newton.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "scenes/body_scenes.hpp"
#include "scenes/box_scenes.hpp"

namespace stiction::bench {

namespace {

using distributed::DomainOptions;
using distributed::NewtonCounts;
using distributed::RankReport;

BodyEnvironment<double> make_scene(const std::string& name, Index size) {
  if (name == "wall") return scenes::box_bodies(scenes::box_wall(size, size), 0.5);
  if (name == "tower") return scenes::box_bodies(scenes::box_tower(size), 0.5);
  if (name == "pile") return scenes::make_body_pile(1, size);
  if (name == "column") return scenes::make_body_column(1, size, 15 * size);
  throw Error(ErrorCode::invalid_argument, "--scene " + name + ": expected wall, pile, tower or column");
}

struct Counts {
  EnvStatus status{};
  NewtonCounts newton;
  std::int64_t exchanges = 0, gathers = 0, bytes = 0;
  double seconds = 0;  ///< of the slowest rank
};

/// By Newton's method, or by sequential impulses.
Counts count(const BodyBatch<double>& batch, int ranks, const DomainOptions& domains, const TimeStepping& stepping,
             const BodySolverOptions& options) {
  const bool by_newton = options.method == BodyMethod::newton;
  const BodyBatchView<double> view = batch.view();
  const std::vector<int> part =
      distributed::bisect(distributed::centres_by_arms(view), by_newton ? domains.count : ranks);
  const std::vector<int> home = distributed::neighbouring_homes(domains.count, ranks);
  std::vector<double> impulse(static_cast<std::size_t>(3 * view.contact_count));
  std::vector<double> twist(static_cast<std::size_t>(6 * view.body_count));
  Counts counts;
  // A loaded machine is slow, and nothing here is about time.
  distributed::run_thread_ranks(ranks, 3600, [&](distributed::Transport& transport) {
    BodySolutionView<double> solution;
    NewtonCounts made;
    if (transport.rank() == 0) solution = {impulse.data(), twist.data(), nullptr, &counts.status};
    const std::vector<RankReport> all =
        by_newton ? distributed::solve_by_newton<double>(transport, view, part, home, domains, stepping, options,
                                                         solution, nullptr, &made)
                  : distributed::solve_over_ranks<double>(transport, view, part, stepping, options, solution);
    if (transport.rank() != 0) return;
    counts.newton = made;
    if (!by_newton) counts.newton.sweeps = counts.status.iterations;
    for (const RankReport& rank : all) counts.seconds = std::max(counts.seconds, rank.seconds);
    for (const RankReport& rank : all) {
      counts.exchanges = std::max(counts.exchanges, rank.exchanges);
      counts.gathers = std::max(counts.gathers, rank.gathers);
      counts.bytes += rank.bytes;
    }
  });
  return counts;
}

DomainOptions domains_of(const std::string& kind, int subdomains, Offset bodies) {
  if (kind != "neither" && kind != "overlap" && kind != "coarse" && kind != "both" && kind != "si")
    throw Error(ErrorCode::invalid_argument, "--kinds " + kind + ": expected neither, overlap, coarse, both or si");
  DomainOptions domains;
  domains.count = subdomains > 0 ? subdomains : static_cast<int>(bodies);
  domains.overlap = kind == "overlap" || kind == "both";
  domains.is_coarse = kind == "coarse" || kind == "both";
  return domains;
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--scene", "wall"},
                             {"--sizes", "16"},
                             {"--ranks", "2"},
                             {"--subdomains", "2,4,8,16"},
                             {"--law", "convex"},
                             {"--cfm", "1e-5"},
                             {"--tolerances", "1e-6"},
                             {"--kinds", "neither,overlap,coarse,both"},
                             {"--first-sweeps", "48"},
                             {"--limit", "1000"}});
  const std::string& scene = arguments.text("--scene");
  const int ranks = arguments.count("--ranks");
  TimeStepping stepping;
  stepping.cfm = arguments.number("--cfm");
  BodySolverOptions options;
  options.law = arguments.text("--law") == "convex" ? Law::convex : Law::coulomb;
  options.iterations = arguments.count("--limit");
  const auto csv = arguments.csv(
      "scene,size,bodies,contacts,law,cfm,kind,ranks,subdomains,tolerance,steps,sweeps,linear_iterations,residual,code,"
      "exchanges,gathers,bytes");
  std::printf("%-6s %6s %7s %-8s %6s %9s %6s %7s %8s %9s %-14s %9s %8s %12s %8s\n", "scene", "size", "bodies", "kind",
              "parts", "tolerance", "steps", "sweeps", "linear", "residual", "ended", "exchanges", "gathers", "bytes",
              "seconds");
  for (const int size : arguments.counts("--sizes")) {
    BodyBatch<double> batch;
    batch.add(make_scene(scene, size));
    for (const double tolerance : arguments.numbers("--tolerances"))
      for (const std::string& kind : arguments.texts("--kinds"))
        for (const int subdomains : arguments.counts("--subdomains", 0)) {
          options.tolerance = tolerance;
          options.method = kind == "si" ? BodyMethod::impulses : BodyMethod::newton;
          DomainOptions domains = domains_of(kind, subdomains, batch.body_count());
          domains.sweeps = arguments.count("--first-sweeps");
          const Counts counts = count(batch, ranks, domains, stepping, options);
          const EnvStatus& status = counts.status;
          const auto wide = [](std::int64_t number) { return static_cast<long long>(number); };
          std::printf("%-6s %6d %7lld %-8s %6d %9.0e %6lld %7lld %8lld %9.1e %-14s %9lld %8lld %12lld %8.1f\n",
                      scene.c_str(), size, wide(batch.body_count()), kind.c_str(), domains.count, tolerance,
                      wide(counts.newton.steps), wide(counts.newton.sweeps), wide(counts.newton.linear_steps),
                      status.residual, to_string(status.code), wide(counts.exchanges), wide(counts.gathers),
                      wide(counts.bytes), counts.seconds);
          std::fflush(stdout);
          if (csv)
            csv->row({scene, std::to_string(size), std::to_string(batch.body_count()),
                      std::to_string(batch.contact_count()), to_string(options.law), number(stepping.cfm), kind,
                      std::to_string(ranks), kind == "si" ? "" : std::to_string(domains.count), number(tolerance),
                      std::to_string(counts.newton.steps), std::to_string(counts.newton.sweeps),
                      std::to_string(counts.newton.linear_steps), number(status.residual), to_string(status.code),
                      std::to_string(counts.exchanges), std::to_string(counts.gathers), std::to_string(counts.bytes)});
        }
  }
  return 0;
}

}  // namespace stiction::bench
