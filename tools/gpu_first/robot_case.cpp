#include "tools/gpu_first/robot_case.hpp"

#include <cmath>
#include <random>

#include "scenes/scenes.hpp"
#include "tests/support/golden/case.hpp"
#include "tests/support/systems/jacobian_answer.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tools/gpu_first/recorded.hpp"

namespace stiction::gpu_first {

namespace {

constexpr double kNear = 1e-6, kChange = 0.05;

/// Compliances as MuJoCo's defaults give them: a share of A's diagonal on a contact's normal row.
std::vector<float> compliances(const Environment<double>& system) {
  constexpr double kShare = 0.05;
  std::vector<float> R;
  for (const auto& cone : system.cones) {
    const Index row = static_cast<Index>(R.size());
    double diagonal = 0;
    for (auto k = static_cast<std::size_t>(system.row_offsets[R.size()]);
         k < static_cast<std::size_t>(system.row_offsets[R.size() + 1]); ++k)
      if (system.column[k] == row) diagonal += system.A[k];
    R.insert(R.end(), static_cast<std::size_t>(cone.row_count), static_cast<float>(kShare * diagonal));
  }
  return R;
}

/// J and M of a scene, M in blocks or dense (0).
JacobianEnvironment<float> environment_of(const scenes::SceneEnv& made, Index block) {
  const auto narrow = [](const std::vector<double>& numbers) {
    return std::vector<float>(numbers.begin(), numbers.end());
  };
  const Index width = block == 0 ? made.dof_count : block;
  JacobianEnvironment<float> env;
  for (const auto& cone : made.system.cones) env.cones.push_back({cone.kind, cone.row_count});
  env.row_offsets = made.J.ptr;
  env.column = made.J.col;
  env.J = narrow(made.J.val);
  env.M.assign(static_cast<std::size_t>(made.dof_count * width), 0.0F);
  for (Index i = 0; i < made.dof_count; ++i)
    for (auto k = static_cast<std::size_t>(made.M.ptr[static_cast<std::size_t>(i)]);
         k < static_cast<std::size_t>(made.M.ptr[static_cast<std::size_t>(i) + 1]); ++k)
      env.M[static_cast<std::size_t>(i * width + made.M.col[k] % width)] = static_cast<float>(made.M.val[k]);
  env.v_free = narrow(made.v_free);
  env.target = narrow(made.row_target);
  env.R = compliances(made.system);
  env.mu = narrow(made.system.mu);
  env.lo = narrow(made.system.lo);
  env.hi = narrow(made.system.hi);
  return env;
}

/// Environments of a scene, of a size, with so many cones where `cones` is not zero.
JacobianBatch<float> scene_batch(const char* scene, int size, std::size_t cones, Index block, Offset count) {
  JacobianBatch<float> batch(Law::convex, MassForm::matrix, block);
  for (std::uint64_t index = 0; batch.env_count() < count; ++index) {
    const scenes::SceneEnv made = scenes::make(scene, 7, index, size);
    const bool is_wanted = cones == 0 ? !made.system.cones.empty() : made.system.cones.size() == cones;
    if (is_wanted) batch.add(environment_of(made, block));
  }
  return batch;
}

/// Free velocities, each changed a little: by the sum of four uniform numbers, which is nearly normal and the same
/// everywhere.
std::vector<float> nudged(std::vector<float> velocities) {
  std::mt19937_64 random(11);  // NOLINT(bugprone-random-generator-seed): the same numbers everywhere
  const auto uniform = [&] { return static_cast<double>(random() >> 11) * 0x1p-53 - 0.5; };
  for (float& v : velocities)
    v *= static_cast<float>(1 + kChange * std::sqrt(3.0) * (uniform() + uniform() + uniform() + uniform()));
  return velocities;
}

using Answer = test::JacobianAnswer<float>;

Answer solve_here(const JacobianBatchView<float>& batch, const SolverOptions& options,
                  const JacobianStart<float>& start = {}) {
  Answer answer(batch);
  JacobianSolver<float>(Device::cpu(), options, JacobianCapacity::of(batch)).solve(batch, answer.view(), start);
  return answer;
}

Hashes hashes_of(const JacobianBatchView<float>& batch, const Answer& answer) {
  Hashes hashes;
  for (Offset env = 0; env < batch.env_count; ++env) {
    const auto part = [](const std::vector<float>& all, Offset begin, Offset end) {
      return std::vector<float>(all.begin() + begin, all.begin() + end);
    };
    const Offset row = batch.env_row_offsets[env], end = batch.env_row_offsets[env + 1];
    test::Digest digest;
    digest.add(part(answer.lambda, row, end)).add(part(answer.w, row, end));
    digest.add(part(answer.velocity, batch.env_dof_offsets[env], batch.env_dof_offsets[env + 1]));
    digest.add(std::span<const EnvStatus>(answer.status).subspan(static_cast<std::size_t>(env), 1));
    hashes.push_back(digest.value());
  }
  return hashes;
}

std::vector<float> in_turn(const std::vector<float>& numbers, std::size_t length) {
  std::vector<float> all(length);
  for (std::size_t i = 0; i < length; ++i) all[i] = numbers[i % numbers.size()];
  return all;
}

}  // namespace

std::optional<RobotCase> robot_case(const Setting& setting, const std::string& name) {
  constexpr Offset kPiles = 16, kWalkers = 32, kFew = 3;
  std::optional<JacobianBatch<float>> found;
  if (name == "piles") {
    found = scene_batch("pile", 30, 64, 6, setting.full ? kPiles : 1);  // spheres of 6 degrees of freedom, 64 contacts
  } else if (name == "walkers") {
    found = scene_batch("walker", 4, 0, 0, setting.full ? kWalkers : kFew);
  } else {
    found = read_recorded(setting.batches, name);
    if (found && !setting.full) found = repeated(*found, kFew);
  }
  if (!found) return std::nullopt;
  RobotCase made{name, std::move(*found), {}, {}, {}};
  made.matrices = assemble(made.jacobians.view(), FactorUse::never);
  JacobianBatchView<float> near = made.jacobians.view();
  const std::vector<float> v_free = nudged(made.jacobians.arrays().v_free);
  near.v_free = v_free.data();
  Answer answer = solve_here(near, RobotSolve(RobotForm::jacobian, SolverKind::automatic, kNear).options);
  made.velocities = std::move(answer.velocity);
  made.reactions = std::move(answer.lambda);
  return made;
}

RobotCase repeated(const RobotCase& of, Offset envs, RobotForm form) {
  RobotCase all{of.name, JacobianBatch<float>(of.jacobians.view().law), ContactBatch<float>(of.matrices.law()), {}, {}};
  if (form == RobotForm::jacobian) {
    all.jacobians = repeated(of.jacobians, envs);
  } else {
    std::vector<Offset> order(static_cast<std::size_t>(envs));
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Offset>(i) % of.env_count();
    all.matrices = gather(of.matrices, std::span<const Offset>(order));
  }
  const Offset rows = form == RobotForm::jacobian ? all.jacobians.row_count() : all.matrices.row_count();
  all.reactions = in_turn(of.reactions, static_cast<std::size_t>(rows));
  all.velocities = in_turn(of.velocities, static_cast<std::size_t>(all.jacobians.dof_count()));
  return all;
}

RobotSolve::RobotSolve(RobotForm form_of, SolverKind solver, double tolerance) : form(form_of) {
  options.law = Law::convex;
  options.invalid = InvalidPolicy::isolate;
  options.solver = solver;
  options.tolerance = tolerance;
  options.max_iterations = 2000;
}

std::string RobotSolve::name() const {
  return std::string(to_string(options.solver)) + " 1e" + std::to_string(std::lround(std::log10(options.tolerance)));
}

Hashes solved_here(const RobotCase& of, const RobotSolve& how, bool is_warm) {
  if (how.form == RobotForm::matrix)
    return test::env_hashes(of.matrices,
                            solve(of.matrices, how.options, Device::cpu(),
                                  is_warm ? std::span<const float>(of.reactions) : std::span<const float>()));
  JacobianStart<float> start;
  if (is_warm) start = {of.reactions.data(), of.velocities.data()};
  return hashes_of(of.jacobians.view(), solve_here(of.jacobians.view(), how.options, start));
}

RobotThere::RobotThere(Target& target, const RobotCase& of, const RobotSolve& how)
    : of_(of), is_jacobian_(how.form == RobotForm::jacobian), arrays_(target.api()) {
  if (is_jacobian_) {
    const auto host = of.jacobians.view();
    by_jacobians_.emplace(target.device(), how.options, JacobianCapacity::of(host));
    jacobians_ = on_device(arrays_, host);
    answer_.velocity = arrays_.room<float>(host.dof_count);
    velocities_ = arrays_.put(of.velocities);
  } else {
    const auto host = of.matrices.view();
    by_matrices_.emplace(target.device(), how.options, Capacity::of(host));
    matrices_ = on_device(arrays_, host);
  }
  const Offset rows = static_cast<Offset>(of.reactions.size());
  const Offset envs = is_jacobian_ ? jacobians_.env_count : matrices_.env_count;
  answer_.lambda = arrays_.room<float>(rows);
  answer_.w = arrays_.room<float>(rows);
  answer_.status = arrays_.room<EnvStatus>(envs);
  reactions_ = arrays_.put(of.reactions);
}

void RobotThere::queue(bool is_warm) {
  const StreamRef stream{arrays_.stream()};
  if (is_jacobian_) {
    JacobianStart<float> start;
    if (is_warm) start = {reactions_, velocities_};
    by_jacobians_->solve(jacobians_, answer_, start, stream);
  } else {
    by_matrices_->solve(matrices_, SolutionView<float>(answer_), is_warm ? reactions_ : nullptr, stream);
  }
}

Hashes RobotThere::hashes() {
  arrays_.synchronize();
  if (!is_jacobian_) return test::env_hashes(of_.matrices, fetch(arrays_, matrices_, SolutionView<float>(answer_)));
  const auto host = of_.jacobians.view();
  Answer answer(host);
  answer.lambda = arrays_.fetch(answer_.lambda, host.row_count);
  answer.w = arrays_.fetch(answer_.w, host.row_count);
  answer.velocity = arrays_.fetch(answer_.velocity, host.dof_count);
  answer.status = arrays_.fetch(answer_.status, host.env_count);
  return hashes_of(host, answer);
}

}  // namespace stiction::gpu_first
