#include "bench/support/class_model.hpp"
#include "bench/support/contact_batch.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/timing.hpp"

/// Times of batches in the device's memory, as graphs. A device that the CPU stands in for runs them once: its times
/// show only that the programs work.
namespace stiction::gpu_first {

namespace {

constexpr Index kShort = 20, kLong = 60;       // sweeps of the two solves whose difference is taken
constexpr Offset kEntries = Offset{64} << 20;  // of A in a batch

SolverOptions exactly(SolverKind solver, Index sweeps) {
  SolverOptions options = bench::fixed_sweeps(solver, sweeps);
  options.law = Law::convex;
  return options;
}

ContactBatch<float> timed_batch(const bench::ClassModel& model, bool full) {
  if (model.size_class == SizeClass::sparse_device || model.size_class == SizeClass::sparse_block) {
    const Offset envs = model.size_class == SizeClass::sparse_device ? 1 : full ? 264 : 1;
    return convert<float>(test::scene_batch(model.scene, envs, 7, model.size));
  }
  return bench::make_contacts<float>(model.scene, model.size,
                                     full ? bench::capped_envs(model.size, 8192, kEntries) : 4);
}

void time_class(Report& report, const bench::ClassModel& model) {
  if (report.target() == nullptr) return report.left_out("", "the CPU is timed by bench_classes");
  const ContactBatch<float> batch = timed_batch(model, report.setting().full);
  const bool full = report.setting().full;
  const Index few = full ? kShort : 1, many = full ? kLong : 2;
  const auto least = Timed(*report.target(), batch, exactly(SolverKind::npgs, few)).solve(repeats(report), false);
  const auto most = Timed(*report.target(), batch, exactly(SolverKind::npgs, many)).solve(repeats(report), false);
  const auto envs = static_cast<double>(batch.env_count()), cones = static_cast<double>(batch.view().cone_count);
  report.measured("npgs f32", [&](JsonLine& line) {
    line.add("envs", batch.env_count()).add("contacts", cones / envs).add("us_few", least.median);
    line.add("us_many", most.median).add("us_many_least", most.least).add("sweeps_few", few).add("sweeps_many", many);
    const double slope = 1e3 * (most.median - least.median) / (cones * (many - few));
    line.add("ns_per_contact_and_sweep", slope).add("model_ns", model.gpu);
    line.add("ns_per_env", 1e3 * most.median / envs);
  });
}

/// Measures planning beside a solve that does nothing.
void time_plan(Report& report) {
  if (report.target() == nullptr) return report.left_out("", "the CPU is timed by bench_classes");
  for (Offset envs = report.setting().full ? 1024 : 8; envs <= (report.setting().full ? 65536 : 8); envs *= 4) {
    const ContactBatch<float> batch = bench::make_contacts<float>("stack", 4, envs);
    Timed timed(*report.target(), batch, exactly(SolverKind::npgs, 1));
    const double with = timed.solve(repeats(report), true).median, without = timed.solve(repeats(report), false).median;
    report.measured("stack 4, " + std::to_string(envs), [&](JsonLine& line) {
      line.add("envs", envs).add("us_plan", with - without).add("us_with", with).add("us_without", without);
    });
  }
}

}  // namespace

void add_times(Checks& checks) {
  for (const bench::ClassModel& model : bench::class_models())
    checks.push_back({std::string("time/") + model.name, 15, [&model](Report& report) { time_class(report, model); }});
  checks.push_back({"time/plan", 15, time_plan});
}

}  // namespace stiction::gpu_first
