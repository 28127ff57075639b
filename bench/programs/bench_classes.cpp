// Costs of each size class, the bound of a model, and losses between the classes. Losses go to batches of few
// environments, to ragged ones, and to planning. Single precision, npgs.
//
//   bench_classes [--device cpu|cuda|emulated] [--parts classes,envs,ragged,plan] [--threads 1] [--repeats 5]
//                 [--envs 65536] [--csv PATH]
//
// Batches are in host memory, and on a GPU a whole call copies them: only differences of calls tell what it computes.
// One CPU thread is measured in CPU time, everything else by the wall clock.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>

#include "bench/support/arguments.hpp"
#include "bench/support/class_model.hpp"
#include "bench/support/contact_batch.hpp"
#include "bench/support/csv.hpp"
#include "bench/support/machine.hpp"
#include "bench/support/table_main.hpp"
#include "scenes/scenes.hpp"
#include "stiction/stiction.hpp"

namespace stiction::bench {

namespace {

using Real = float;
constexpr SolverKind kSolver = SolverKind::npgs;
constexpr Index kShort = 20, kLong = 60;      // sweeps of the two calls whose difference is taken
constexpr double kLeastSeconds = 0.02;        // of one measurement; shorter calls are repeated inside it
constexpr Offset kEntries = Offset{2} << 20;  // of A in a batch of the classes

struct Setting {
  Device device;
  std::string device_name;
  int threads = 1;
  int repeats = 5;
  Offset most_envs = 65536;
  Csv* csv = nullptr;

  /// Options of a run that takes exactly that many sweeps in every environment.
  [[nodiscard]] SolverOptions sweeps(Index count) const {
    SolverOptions options = fixed_sweeps(kSolver, count);
    options.threads = threads;
    return options;
  }
};

/// One number of the table: its subject, and if it was timed, computed by a model, or is a ratio.
struct Line {
  std::string part, name;
  double contacts = 0;  ///< of an environment, on average
  Offset envs = 0;
  std::string quantity;
  double value = 0;
  std::string unit, kind;
  double residual = -1;  ///< of the answer that was computed on the way; negative: none
  std::string hash;
};

void write(const Setting& setting, const Line& line) {
  if (setting.csv == nullptr) return;
  setting.csv->row({line.part, line.name, setting.device_name, number(line.contacts), std::to_string(line.envs),
                    line.quantity, number(line.value), line.unit, line.kind,
                    line.residual < 0 ? "" : number(line.residual), line.hash});
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A batch with its plan and room for its answer, solved as often as wanted.
class Problem {
 public:
  Problem(const Setting& setting, ContactBatch<Real> batch, SolverOptions options)
      : batch_(std::move(batch)),
        is_cpu_time_(setting.device.kind == DeviceKind::cpu && options.threads == 1),
        solver_(setting.device, options),
        plan_(solver_.plan(batch_.view())),
        lambda_(static_cast<std::size_t>(batch_.row_count())),
        w_(lambda_.size()),
        status_(static_cast<std::size_t>(batch_.env_count())) {}

  void solve() { solver_.solve(plan_, batch_.view(), {lambda_.data(), w_.data(), status_.data()}); }
  void plan() { plan_ = solver_.plan(batch_.view()); }

  /// Seconds of one call, of as many as a measurement needs.
  template <class F>
  double time(F&& call) {
    if (calls_ == 0) {
      call();
      const double once = measure(1, call);
      calls_ = std::max(1, static_cast<int>(kLeastSeconds / std::max(once, 1e-7)));
    }
    return measure(calls_, call);
  }
  double time_solve() {
    return time([this] { solve(); });
  }

  [[nodiscard]] const ContactBatch<Real>& batch() const { return batch_; }
  [[nodiscard]] double contacts() const {
    return static_cast<double>(batch_.view().cone_count) / static_cast<double>(batch_.env_count());
  }
  [[nodiscard]] double residual() const { return worst_residual(batch_, lambda_); }
  [[nodiscard]] std::string hash() const { return hash_text(lambda_); }

 private:
  [[nodiscard]] double now() const { return is_cpu_time_ ? cpu_seconds() : wall_seconds(); }
  template <class F>
  double measure(int calls, F&& call) const {
    const double start = now();
    for (int i = 0; i < calls; ++i) call();
    return (now() - start) / calls;
  }

  ContactBatch<Real> batch_;
  bool is_cpu_time_;
  Solver solver_;
  Plan plan_;
  std::vector<Real> lambda_, w_;
  std::vector<EnvStatus> status_;
  int calls_ = 0;
};

ContactBatch<Real> scene_batch(const std::string& scene, Offset envs, int size) {
  ContactBatch<double> batch(Law::coulomb);
  for (Offset e = 0; e < envs; ++e) batch.add(scenes::make(scene, 7, static_cast<std::uint64_t>(e), size).system);
  return convert<Real>(batch);
}

ContactBatch<Real> class_batch(const ClassModel& model) {
  if (model.size_class == SizeClass::sparse_device) return scene_batch(model.scene, 1, model.size);
  if (model.size_class == SizeClass::sparse_block) return scene_batch(model.scene, 8, model.size);
  return make_contacts<Real>(model.scene, model.size, capped_envs(model.size, 4096, kEntries));
}

Index row_count(const ContactBatchView<Real>& view, Offset env) {
  return static_cast<Index>(view.env_row_offsets[env + 1] - view.env_row_offsets[env]);
}

SizeClass class_of(const ContactBatchView<Real>& view, Offset env) {
  const Offset entries = view.row_offsets[view.env_row_offsets[env + 1]] - view.row_offsets[view.env_row_offsets[env]];
  return size_class(choose_path(row_count(view, env), entries), row_count(view, env));
}

/// One class on the machine, the model's floor for it, and their ratio.
void run_classes(const Setting& setting) {
  std::printf("\nsize classes: difference of %d and %d sweeps\n", kShort, kLong);
  std::printf("%-14s %-6s %9s %6s %14s %10s %8s %10s  %-16s %s\n", "class", "scene", "contacts", "envs",
              "ns/contact/swp", "model", "ratio", "residual", "hash", "the model");
  for (const ClassModel& model : class_models()) {
    Problem brief(setting, class_batch(model), setting.sweeps(kShort));
    Problem lengthy(setting, class_batch(model), setting.sweeps(kLong));
    if (class_of(brief.batch().view(), 0) != model.size_class)
      throw Error(ErrorCode::invalid_argument, std::string("the batch of ") + model.name + " is of another class");
    std::vector<double> slope;
    for (int repeat = 0; repeat < setting.repeats; ++repeat) {
      const double start = brief.time_solve();
      slope.push_back(lengthy.time_solve() - start);
    }
    const double contacts = static_cast<double>(brief.batch().view().cone_count);
    const Offset envs = brief.batch().env_count();
    const double measured = 1e9 * median(slope) / (contacts * (kLong - kShort));
    const bool is_cpu = setting.device.kind == DeviceKind::cpu, is_cuda = setting.device.kind == DeviceKind::cuda;
    const double floor = is_cpu ? model.cpu : is_cuda ? model.gpu : 0;
    const char* const source = is_cpu ? model.cpu_source : is_cuda ? model.gpu_source : "none for this device";
    std::printf("%-14s %-6s %9.1f %6lld %14.4g %10.4g %8.3g %10.2e  %-16s %s\n", model.name, model.scene,
                brief.contacts(), static_cast<long long>(envs), measured, floor, floor > 0 ? measured / floor : 0.0,
                lengthy.residual(), lengthy.hash().c_str(), source);
    std::fflush(stdout);
    Line line{"classes",          model.name, brief.contacts(),   envs,          "time", measured,
              "ns/contact/sweep", "timed",    lengthy.residual(), lengthy.hash()};
    write(setting, line);
    if (floor <= 0) continue;
    line.quantity = std::string("floor: ") + source;
    std::replace(line.quantity.begin(), line.quantity.end(), ',', ';');
    line.value = floor;
    line.kind = "model";
    line.residual = -1;
    line.hash.clear();
    write(setting, line);
    line.quantity = "time / floor";
    line.value = measured / floor;
    line.unit = "-";
    line.kind = "ratio";
    write(setting, line);
  }
}

/// Environments a second, from one environment to many.
void run_envs(const Setting& setting) {
  constexpr Index kContacts = 4;
  std::printf("\nenvironments of %d contacts, %d sweeps, whole calls\n", kContacts, kShort);
  std::printf("%8s %14s %14s %10s  %s\n", "envs", "us/call", "envs/s", "residual", "hash");
  for (Offset envs = 1; envs <= setting.most_envs; envs *= 4) {
    Problem problem(setting, make_contacts<Real>("stack", kContacts, envs), setting.sweeps(kShort));
    std::vector<double> seconds;
    for (int repeat = 0; repeat < setting.repeats; ++repeat) seconds.push_back(problem.time_solve());
    const double rate = static_cast<double>(envs) / median(seconds);
    std::printf("%8lld %14.5g %14.5g %10.2e  %s\n", static_cast<long long>(envs), 1e6 * median(seconds), rate,
                problem.residual(), problem.hash().c_str());
    std::fflush(stdout);
    write(setting,
          {"envs", "stack", kContacts, envs, "rate", rate, "1/s", "timed", problem.residual(), problem.hash()});
  }
}

/// Environments in one ragged batch, and the same in a uniform batch for each size: equal work.
void run_ragged(const Setting& setting) {
  constexpr int kSizes = 6;  // boxes of a stack, four contacts each
  constexpr Offset kEnvs = 3072;
  const SolverOptions options = setting.sweeps(kShort);
  ContactBatch<double> distinct(Law::coulomb);
  for (Offset e = 0; e < kSizes * kDistinct; ++e)
    distinct.add(scenes::make("stack", 7, static_cast<std::uint64_t>(e), 1 + static_cast<int>(e % kSizes)).system);
  const ContactBatch<Real> source = convert<Real>(distinct);
  const auto take = [&](Offset first, Offset stride) {
    std::vector<Offset> order;
    for (Offset e = first; e < kEnvs; e += stride) order.push_back(e % source.env_count());
    return gather<Real>(source, order);
  };
  // Neighbours in the batch differ in size.
  Problem ragged(setting, take(0, 1), options);
  std::vector<std::unique_ptr<Problem>> uniform;
  for (Offset size = 0; size < kSizes; ++size)
    uniform.push_back(std::make_unique<Problem>(setting, take(size, kSizes), options));
  std::vector<double> ratio, together;
  for (int repeat = 0; repeat < setting.repeats; ++repeat) {
    together.push_back(ragged.time_solve());
    double apart = 0;
    for (const auto& problem : uniform) apart += problem->time_solve();
    ratio.push_back(apart / together.back());
  }
  std::printf("\nragged: %lld stacks of 1 to %d boxes, one batch against %d uniform ones of the same environments\n",
              static_cast<long long>(kEnvs), kSizes, kSizes);
  std::printf("  %.4g us/call, %.3f times the uniform batches' throughput, residual %.2e, hash %s\n",
              1e6 * median(together), median(ratio), ragged.residual(), ragged.hash().c_str());
  write(setting, {"ragged", "stack 1-6", ragged.contacts(), kEnvs, "throughput ragged / uniform", median(ratio), "-",
                  "timed", ragged.residual(), ragged.hash()});
}

/// Share of planning in planning and solving together.
void run_plan(const Setting& setting) {
  std::printf("\nplanning: share of plan() in plan() and solve() together, %d sweeps\n", kShort);
  std::printf("%-8s %8s %12s %12s %8s\n", "batch", "envs", "plan us", "solve us", "share");
  const Offset few = std::min<Offset>(1024, setting.most_envs), many = std::min<Offset>(16384, setting.most_envs);
  for (const auto& [name, envs] : {std::pair{"stack4", few}, {"stack4", many}, {"mixed", few}, {"pile", Offset{8}}}) {
    const std::string scene = name;
    Problem planned(
        setting,
        scene == "stack4" ? make_contacts<Real>("stack", 4, envs) : scene_batch(scene, envs, scene == "pile" ? 100 : 0),
        setting.sweeps(kShort));
    Problem solved(setting, planned.batch(), setting.sweeps(kShort));
    std::vector<double> share, plan_seconds, solve_seconds;
    for (int repeat = 0; repeat < setting.repeats; ++repeat) {
      plan_seconds.push_back(planned.time([&] { planned.plan(); }));
      solve_seconds.push_back(solved.time_solve());
      share.push_back(plan_seconds.back() / (plan_seconds.back() + solve_seconds.back()));
    }
    std::printf("%-8s %8lld %12.5g %12.5g %7.1f%%\n", name, static_cast<long long>(envs), 1e6 * median(plan_seconds),
                1e6 * median(solve_seconds), 100 * median(share));
    std::fflush(stdout);
    write(setting, {"plan", name, solved.contacts(), envs, "planning / (planning + solving)", median(share), "-",
                    "timed", solved.residual(), solved.hash()});
  }
}

}  // namespace

int run(int argc, char** argv) {
  const Arguments arguments(argc, argv,
                            {
                                {"--device", "cpu"},
                                {"--parts", "classes,envs,ragged,plan"},
                                {"--threads", "1"},
                                {"--repeats", "5"},
                                {"--envs", "65536"},
                            });
  const std::map<std::string, void (*)(const Setting&)> parts{
      {"classes", run_classes}, {"envs", run_envs}, {"ragged", run_ragged}, {"plan", run_plan}};
  for (const std::string& part : arguments.texts("--parts"))
    if (!parts.contains(part))
      throw Error(ErrorCode::invalid_argument, "part '" + part + "' is unknown: use classes, envs, ragged, plan");
  Setting setting;
  setting.device = Device::from_string(arguments.text("--device"));
  setting.device_name = arguments.text("--device");
  setting.threads = arguments.count("--threads", 0);
  setting.repeats = arguments.count("--repeats");
  setting.most_envs = arguments.count("--envs");
  const auto csv = arguments.csv("part,case,device,contacts,envs,quantity,value,unit,kind,residual,hash");
  setting.csv = csv.get();
  for (const auto& [name, value] : describe_machine()) std::printf("# %s: %s\n", name.c_str(), value.c_str());
  std::printf("# device: %s\n", setting.device_name.c_str());
  for (const std::string& part : arguments.texts("--parts")) parts.at(part)(setting);
  return 0;
}

}  // namespace stiction::bench
