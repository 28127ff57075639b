#include <limits>

#include "bench/support/class_model.hpp"
#include "bench/support/contact_batch.hpp"
#include "cuda/machine/contact_machine.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/oracles/plan_integers.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/random_structures.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/twin_batches.hpp"
#include "tools/gpu_first/check.hpp"

/// Contact batches: the scheduler's integers, each class of sizes, every solver.
namespace stiction::gpu_first {

namespace {

using test::env_hashes;

/// Describes an environment that differs.
template <class Real>
auto description_of(const ContactBatch<Real>& batch) {
  return [&batch](JsonLine& line, std::size_t env) {
    if (env >= static_cast<std::size_t>(batch.env_count())) return;
    const auto view = batch.view();
    line.add("rows", view.env_rows(static_cast<Offset>(env))).add("cones", view.env_cones(static_cast<Offset>(env)));
  };
}

template <class Real>
void compare(Report& report, const std::string& part, const ContactBatch<Real>& batch, const SolverOptions& options) {
  report.compare(
      part, [&] { return env_hashes(batch, solve(batch, options)); },
      [&] { return env_hashes(batch, solve(batch, options, report.target()->device())); }, description_of(batch));
}

void plan(Report& report) {
  if (report.target() == nullptr) return report.left_out("", "the CPU plans otherwise");
  const auto judge = [&](const std::string& part, const ContactBatch<double>& batch) {
    report.judge(part, test::difference_of_plans(*report.target()->api(), batch));
  };
  std::mt19937 random(5);  // NOLINT(bugprone-random-generator-seed): the same batches everywhere
  for (int k = 0; k < 10; ++k) judge("random " + std::to_string(k), test::random_structures(random));
  judge("ragged", test::ragged_batch(report.setting().full ? 40 : 2, 1));
  judge("mixed", test::scene_batch("mixed", report.setting().full ? 20000 : 60, 3));
}

SolverOptions sweeps_of(SolverKind solver, Law law, Index most) {
  SolverOptions options = test::options(solver, 1e-6, most);
  options.law = law;
  options.invalid = InvalidPolicy::isolate;
  options.threads = 0;
  return options;
}

/// Environments of one class of sizes.
ContactBatch<float> class_batch(const bench::ClassModel& model, bool full) {
  const bool is_sparse = model.size_class <= SizeClass::sparse_block;
  if (!is_sparse) return bench::make_contacts<float>(model.scene, model.size, full ? 512 : 10);
  const Offset envs = model.size_class == SizeClass::sparse_device ? 2 : full ? 64 : 2;
  return convert<float>(test::scene_batch(model.scene, envs, 7, model.size));
}

void solve_class(Report& report, const bench::ClassModel& model) {
  const bool full = report.setting().full, is_giant = model.size_class == SizeClass::sparse_device;
  const ContactBatch<float> batch = class_batch(model, full);
  const auto view = batch.view();
  for (Offset env = 0; env < view.env_count; ++env) {
    const Offset row = view.env_row_offsets[env], end = view.env_row_offsets[env + 1];
    const Offset entries = view.row_offsets[end] - view.row_offsets[row];
    if (size_class(choose_path(view.env_rows(env), entries), view.env_rows(env)) != model.size_class)
      return report.judge("batch", "environment " + std::to_string(env) + " is of another class");
  }
  const Index most = full ? 60 : is_giant ? 3 : 12;
  for (const Law law : test::kBothLaws)
    compare(report, std::string("npgs f32 ") + to_string(law), batch, sweeps_of(SolverKind::npgs, law, most));
}

/// Small environments in each larger class.
void solve_in_larger_classes(Report& report) {
  const ContactBatch<float> batch = convert<float>(test::scene_batch("mixed", report.setting().full ? 400 : 6, 5));
  const SolverOptions options = sweeps_of(SolverKind::npgs, Law::convex, report.setting().full ? 60 : 12);
  for (const auto& [finest, name] : {std::pair{SizeClass::thread_medium, "thread_medium"},
                                     {SizeClass::thread_large, "thread_large"},
                                     {SizeClass::dense_tile, "dense_tile"},
                                     {SizeClass::dense_warp, "dense_warp"},
                                     {SizeClass::dense_block, "dense_block"},
                                     {SizeClass::dense_large, "dense_large"}})
    report.compare(
        name, [&] { return env_hashes(batch, solve(batch, options)); },
        [&, finest = finest] {
          cuda::DeviceContactMachine machine(report.target()->api(), cuda::kPieceBytes, cuda::ClassRules::from(finest));
          Solution<float> answer{std::vector<float>(static_cast<std::size_t>(batch.row_count())),
                                 std::vector<float>(static_cast<std::size_t>(batch.row_count())),
                                 std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
          machine.solve(SolveRequest<float>{nullptr,
                                            batch.view(),
                                            {answer.lambda.data(), answer.w.data(), answer.status.data()},
                                            nullptr,
                                            Law::convex,
                                            options,
                                            StreamRef::default_stream()});
          return env_hashes(batch, answer);
        },
        description_of(batch));
}

void solve_factors(Report& report) {
  JacobianBatch<float> jacobians(Law::convex);
  for (std::uint64_t seed = 1; seed <= (report.setting().full ? 256U : 6U); ++seed)
    jacobians.add(test::cast<float>(test::random_jacobian({seed, 8 + static_cast<int>(seed % 9), 6, 18})));
  const ContactBatch<float> batch = assemble(jacobians.view(), FactorUse::always);
  for (const Law law : test::kBothLaws)
    compare(report, std::string("npgs f32 ") + to_string(law), batch,
            sweeps_of(SolverKind::npgs, law, report.setting().full ? 60 : 12));
}

void solve_everything_by(Report& report, SolverKind solver) {
  if (report.target() != nullptr && !carries(*report.target(), solver))
    return report.left_out("", "its kernels were not compiled for this program");
  const bool full = report.setting().full;
  const ContactBatch<double> ragged = full ? test::twin_batch() : test::small_twin_batch();
  const Index most = full ? 60 : test::few_iterations(solver, 8);
  const auto batch = test::batch_for<double>(solver, ragged, full ? 200 : 60);
  const auto single = convert<float>(batch);
  for (const Law law : test::kBothLaws) {
    compare(report, std::string("f32 ") + to_string(law), single, sweeps_of(solver, law, most));
    compare(report, std::string("f64 ") + to_string(law), batch, sweeps_of(solver, law, most));
  }
}

}  // namespace

void add_plan(Checks& checks) {
  checks.push_back({"plan", 30, plan});
}

void add_classes(Checks& checks) {
  for (const bench::ClassModel& model : bench::class_models())
    checks.push_back(
        {std::string("class/") + model.name, 20, [&model](Report& report) { solve_class(report, model); }});
  checks.push_back({"class/factor_warp", 20, solve_factors});
  checks.push_back({"class/larger", 20, solve_in_larger_classes});
}

void add_solvers(Checks& checks) {
  for (const SolverKind solver : test::kEveryChoice)
    checks.push_back({std::string("solver/") + to_string(solver), test::is_costly(solver) ? 40.0 : 20.0,
                      [solver](Report& report) { solve_everything_by(report, solver); }});
}

}  // namespace stiction::gpu_first
