// Towers, walls and pyramids of boxes, double precision, convex law: time of sequential impulses and of Newton's
// method with each preconditioner to a tolerance.
//
//   bench_body_newton [--scenes tower50,tower200,wall20,wall30,pyramid10] [--compliance 1e-3,1e-5]
//                     [--tolerance 1e-3,1e-6] [--repeats 3] [--csv PATH]
//
// CPU time of one thread, the least of the repeats, without the plan, whose time stands beside. Sequential impulses
// stop after 20000 sweeps and Newton's method after 200 steps: then the residual says how far they came.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include "bench/support/arguments.hpp"
#include "bench/support/contact_batch.hpp"
#include "bench/support/csv.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"
#include "scenes/box_scenes.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

BodyEnvironment<double> scene_of(const std::string& name) {
  const std::size_t digits = name.find_first_of("0123456789");
  const std::string kind = name.substr(0, digits);
  const Index size = digits == std::string::npos ? 0 : to_count("--scenes", name.substr(digits));
  if (size > 0 && kind == "tower") return scenes::box_bodies(scenes::box_tower(size), 0.5);
  if (size > 0 && kind == "wall") return scenes::box_bodies(scenes::box_wall(size, size), 0.5);
  if (size > 0 && kind == "pyramid") return scenes::box_bodies(scenes::box_pyramid(size), 0.5);
  throw Error(ErrorCode::invalid_argument, "scene '" + name + "': choose towerN, wallN or pyramidN");
}

struct Method {
  std::string name;
  BodySolverOptions options;
};

std::vector<Method> methods(double tolerance) {
  BodySolverOptions options;
  options.law = Law::convex;
  options.tolerance = tolerance;
  options.threads = 1;
  options.iterations = 20000;
  std::vector<Method> all{{"impulses", options}};
  options.method = BodyMethod::newton;
  options.iterations = 200;
  for (int kind = 0; kind < kBodyPreconditionerCount; ++kind) {
    options.space.preconditioner = static_cast<BodyPreconditioner>(kind);
    if (options.space.preconditioner == BodyPreconditioner::multigrid) continue;
    all.push_back({std::string("newton ") + to_string(options.space.preconditioner), options});
  }
  options.space.preconditioner = BodyPreconditioner::multigrid;
  all.push_back({"newton multigrid smoothed", options});
  options.space.multigrid.prolongation = Prolongation::plain;
  all.push_back({"newton multigrid plain", options});
  return all;
}

void run_method(const std::string& scene, const std::string& compliance, const std::string& tolerance,
                const Method& method, const BodyBatchView<double>& view, int repeats, Csv* csv) {
  TimeStepping stepping;
  stepping.cfm = to_number("--compliance", compliance) * stepping.dt;
  const BodySolver solver(Device::cpu(), stepping, method.options);
  const double start = cpu_seconds();
  const BodyPlan plan = solver.plan(view);
  const double plan_seconds = cpu_seconds() - start;
  std::vector<double> impulse(static_cast<std::size_t>(3 * view.contact_count));
  std::vector<double> twist(static_cast<std::size_t>(6 * view.body_count));
  EnvStatus status{};
  double least = 0;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    const double begin = cpu_seconds();
    solver.solve(plan, view, {impulse.data(), twist.data(), nullptr, &status});
    const double seconds = cpu_seconds() - begin;
    if (repeat == 0 || seconds < least) least = seconds;
  }
  const std::string hash = hash_text(impulse);
  std::printf("%-10s %6s %6s  %-28s %8d %10.4f %10.4f %10.2e %-14s %s\n", scene.c_str(), compliance.c_str(),
              tolerance.c_str(), method.name.c_str(), status.iterations, least, plan_seconds, status.residual,
              to_string(status.code), hash.c_str());
  std::fflush(stdout);
  if (csv != nullptr)
    csv->row({scene, std::to_string(view.body_count), std::to_string(view.contact_count), compliance, tolerance,
              method.name, std::to_string(status.iterations), number(least), number(plan_seconds),
              number(status.residual), to_string(status.code), hash});
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {{"--scenes", "tower50,tower200,wall20,wall30,pyramid10"},
                             {"--compliance", "1e-3,1e-5"},
                             {"--tolerance", "1e-3,1e-6"},
                             {"--repeats", "3"}});
  const int repeats = arguments.count("--repeats");
  const auto csv = arguments.csv(
      "scene,bodies,contacts,compliance,tolerance,method,iterations,seconds,seconds_plan,residual,code,hash");
  for (const auto& [name, value] : describe_machine()) std::printf("# %s: %s\n", name.c_str(), value.c_str());
  std::printf("%-10s %6s %6s  %-28s %8s %10s %10s %10s %-14s %s\n", "scene", "R", "to", "method", "its", "solve [s]",
              "plan [s]", "residual", "code", "hash");
  for (const std::string& scene : arguments.texts("--scenes")) {
    BodyBatch<double> batch;
    batch.add(scene_of(scene));
    for (const std::string& compliance : arguments.texts("--compliance"))
      for (const std::string& tolerance : arguments.texts("--tolerance"))
        for (const Method& method : methods(to_number("--tolerance", tolerance)))
          run_method(scene, compliance, tolerance, method, batch.view(), repeats, csv.get());
  }
  return 0;
}

}  // namespace stiction::bench
