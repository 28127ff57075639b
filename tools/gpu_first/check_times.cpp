#include "bench/support/class_model.hpp"
#include "bench/support/contact_batch.hpp"
#include "core/base/extents.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tools/gpu_first/check.hpp"
#include "tools/gpu_first/recorded.hpp"
#include "tools/gpu_first/timing.hpp"

/// Times of batches in the device's memory, as graphs. A device that the CPU stands in for runs them once: its times
/// say nothing but that the programs work.
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

/// What planning costs beside a solve that does nothing.
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

/// Recorded robots: how long one step of very many takes, to the bits that the CPU gives.
void time_robot(Report& report, const std::string& name) {
  const std::optional<ContactBatch<float>> recorded = read_recorded(report.setting().batches, name);
  if (!recorded) return report.left_out("", "there is no " + name + ".batch in '" + report.setting().batches + "'");
  SolverOptions options;
  options.law = Law::convex;
  options.invalid = InvalidPolicy::isolate;
  options.max_iterations = 2000;
  options.solver = SolverKind::npgs;
  options.tolerance = 1e-4;
  report.compare(
      "npgs f32", [&] { return test::env_hashes(*recorded, solve(*recorded, options)); },
      [&] { return test::env_hashes(*recorded, solve(*recorded, options, report.target()->device())); });
  if (report.target() == nullptr) return;
  const bool full = report.setting().full;
  for (const auto& [solver, tolerance] : {std::pair{SolverKind::npgs, 1e-4},
                                          {SolverKind::npgs, 1e-6},
                                          {SolverKind::automatic, 1e-6},
                                          {SolverKind::newton, 1e-6}})
    for (Offset envs = full ? 64 : 2; envs <= (full ? 65536 : 2); envs *= full ? 32 : 2) {
      if (solver != SolverKind::npgs && envs > 2048) continue;
      if (!full && solver != SolverKind::npgs) continue;
      std::vector<Offset> order(static_cast<std::size_t>(envs));
      for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Offset>(i) % recorded->env_count();
      const auto batch = gather(*recorded, std::span<const Offset>(order));
      options.solver = solver;
      options.tolerance = tolerance;
      const auto time = Timed(*report.target(), batch, options).solve(repeats(report), true);
      report.measured(std::string(to_string(solver)) + " " + std::to_string(envs), [&](JsonLine& line) {
        line.add("solver", to_string(solver)).add("tolerance", tolerance).add("envs", envs);
        line.add("rows", static_cast<double>(batch.row_count()) / static_cast<double>(envs));
        line.add("us", time.median).add("us_least", time.least);
        line.add("ns_per_env", 1e3 * time.median / static_cast<double>(envs));
      });
    }
}

/// Which class is fastest for environments of a size, among its own and those of larger ones. A lane for each pays only
/// where there are enough of them.
void tune(Report& report, Index contacts) {
  if (report.target() == nullptr) return report.left_out("", "the CPU has no classes");
  const bool full = report.setting().full;
  for (const Offset envs : full ? std::vector<Offset>{64, 1024, 8192} : std::vector<Offset>{4}) {
    const ContactBatch<float> batch = bench::make_contacts<float>("face", contacts, envs);
    const cuda::ClassRules rules;
    const bool are_many = envs >= rules.many_per_processor * report.target()->api()->facts().processors;
    const SizeClass own =
        size_class(EnvPath::dense, 3 * contacts,
                   are_many ? rules.limits.with(SizeClass::thread_large, rules.most_rows_of_many) : rules.limits);
    Hashes expected;
    for (int k = static_cast<int>(larger_of(own, SizeClass::thread_large));
         k >= static_cast<int>(SizeClass::dense_large); --k) {
      Timed timed(*report.target(), batch, exactly(SolverKind::npgs, full ? 24 : 1),
                  cuda::ClassRules::from(static_cast<SizeClass>(k)));
      const auto time = timed.solve(repeats(report), false);
      const Hashes hashes = timed.hashes();
      if (expected.empty()) expected = hashes;
      if (hashes != expected) report.judge("class " + std::to_string(k), "it has other bits than class of the size");
      report.measured(std::to_string(envs) + " in class " + std::to_string(k), [&](JsonLine& line) {
        line.add("rows", 3 * contacts).add("envs", envs).add("class", k).add("own_class", static_cast<int>(own));
        line.add("us", time.median).add("ns_per_env", 1e3 * time.median / static_cast<double>(envs));
      });
    }
  }
}

}  // namespace

void add_times(Checks& checks) {
  for (const bench::ClassModel& model : bench::class_models())
    checks.push_back({std::string("time/") + model.name, 15, [&model](Report& report) { time_class(report, model); }});
  checks.push_back({"time/plan", 15, time_plan});
  for (const char* const robot : kRecorded)
    checks.push_back({std::string("robot/") + robot, 40, [robot](Report& report) { time_robot(report, robot); }});
}

void add_tuning(Checks& checks) {
  for (const Index contacts : {1, 2, 4, 6, 8, 12, 18, 24, 40})
    checks.push_back(
        {"tune/" + std::to_string(3 * contacts), 20, [contacts](Report& report) { tune(report, contacts); }});
}

}  // namespace stiction::gpu_first
