#include <algorithm>
#include <cmath>
#include <cstdio>

#include "stiction/residual.hpp"
#include "tools/gpu_first/baseline.hpp"
#include "tools/gpu_first/robot_case.hpp"
#include "tools/gpu_first/timing.hpp"

/// The baseline on recorded robots: that its answers are the library's, and its times. Without a GPU its arithmetic
/// runs as a loop.
namespace stiction::gpu_first {

#if !defined(STICTION_HAS_CUDA)
void launch_baseline(const BaselineBatch&, const BaselineAnswer&, float, void*) {}
#endif

namespace {

/// The loosest at which nineteen of twenty recorded environments have a residual of at most 1e-4.
constexpr float kTolerance = 2e-5F;
/// Limits on velocities, as a share of their change by reactions, and on the residual's 95th percentile.
constexpr double kMostApart = 1e-4, kMostApartMedian = 1e-5, kMostResidual = 1e-4;
constexpr Offset kSizes[] = {1024, 4096, 16384, 65536};

/// A batch with dense matrices on the host.
struct Dense {
  BaselineBatch view;
  std::vector<Offset> J_begin, M_begin;
  std::vector<float> J, M;

  explicit Dense(const JacobianBatchView<float>& batch) {
    for (Offset env = 0; env < batch.env_count; ++env) {
      const Index rows = batch.env_rows(env), dofs = batch.env_dofs(env);
      const Offset row = batch.env_row_offsets[env];
      J_begin.push_back(static_cast<Offset>(J.size()));
      M_begin.push_back(static_cast<Offset>(M.size()));
      J.resize(J.size() + static_cast<std::size_t>(rows) * static_cast<std::size_t>(dofs));
      M.resize(M.size() + static_cast<std::size_t>(dofs) * static_cast<std::size_t>(dofs));
      float* const own_J = J.data() + J_begin.back();
      for (Index i = 0; i < rows; ++i)
        for (Offset k = batch.row_offsets[row + i]; k < batch.row_offsets[row + i + 1]; ++k)
          own_J[i * dofs + (batch.column != nullptr ? batch.column[k] : k - batch.row_offsets[row + i])] += batch.J[k];
      float* const own_M = M.data() + M_begin.back();
      const float* const given = batch.M + batch.env_mass_offsets[env];
      const Index width = batch.mass_block == 0 ? dofs : batch.mass_block;
      for (Index i = 0; i < dofs; ++i)
        for (Index j = i - i % width; j <= i; ++j)
          own_M[i * dofs + j] = own_M[j * dofs + i] = given[i * width + j % width];
      view.most_rows = std::max(view.most_rows, rows);
      view.most_dofs = std::max(view.most_dofs, dofs);
    }
    view.envs = batch.env_count;
    view.row = batch.env_row_offsets;
    view.cone = batch.env_cone_offsets;
    view.dof = batch.env_dof_offsets;
    view.J_begin = J_begin.data();
    view.M_begin = M_begin.data();
    view.kind = batch.cone_kind;
    view.cone_row = batch.cone_row_offsets;
    view.J = J.data();
    view.M = M.data();
    view.v_free = batch.v_free;
    view.target = batch.target;
    view.R = batch.R;
    view.mu = batch.mu;
    view.lo = batch.lo;
    view.hi = batch.hi;
  }
};

struct Answer {
  std::vector<float> velocity, lambda;
  std::vector<Index> steps;
};

Answer solve_in_a_loop(const BaselineBatch& batch) {
  Answer answer{std::vector<float>(static_cast<std::size_t>(batch.dof[batch.envs])),
                std::vector<float>(static_cast<std::size_t>(batch.row[batch.envs])),
                std::vector<Index>(static_cast<std::size_t>(batch.envs))};
  std::vector<float> memory(BaselineMemory::floats(batch.most_rows, batch.most_dofs));
  LoopBlock block;
  for (Offset env = 0; env < batch.envs; ++env)
    solve_baseline(block, batch, {answer.velocity.data(), answer.lambda.data(), answer.steps.data()}, env, kTolerance,
                   memory.data());
  return answer;
}

/// The batch and its answer in a device's memory.
class There {
 public:
  There(Target& target, const BaselineBatch& host, Offset J_entries, Offset M_entries)
      : arrays_(target.api()), view_(host) {
    const Offset envs = host.envs, rows = host.row[envs], cones = host.cone[envs];
    dofs_ = host.dof[envs];
    rows_ = rows;
    for (const Offset** const offsets : {&view_.row, &view_.cone, &view_.dof})
      *offsets = arrays_.put(*offsets, envs + 1);
    view_.J_begin = arrays_.put(host.J_begin, envs);
    view_.M_begin = arrays_.put(host.M_begin, envs);
    view_.kind = arrays_.put(host.kind, cones);
    view_.cone_row = arrays_.put(host.cone_row, cones + 1);
    view_.J = arrays_.put(host.J, J_entries);
    view_.M = arrays_.put(host.M, M_entries);
    view_.v_free = arrays_.put(host.v_free, dofs_);
    view_.start = arrays_.put(host.start, dofs_);
    for (const float** const numbers : {&view_.target, &view_.R, &view_.mu, &view_.lo, &view_.hi})
      *numbers = arrays_.put(*numbers, rows);
    answer_ = {arrays_.room<float>(dofs_), arrays_.room<float>(rows), arrays_.room<Index>(envs)};
  }
  void queue() { launch_baseline(view_, answer_, kTolerance, arrays_.stream()); }
  [[nodiscard]] cuda::StreamHandle stream() const { return arrays_.stream(); }
  Answer fetch() {
    arrays_.synchronize();
    return {arrays_.fetch(answer_.velocity, dofs_), arrays_.fetch(answer_.lambda, rows_),
            arrays_.fetch(answer_.steps, view_.envs)};
  }

 private:
  Arrays arrays_;
  BaselineBatch view_;
  BaselineAnswer answer_;
  Offset dofs_ = 0, rows_ = 0;
};

double norm_of_difference(const float* left, const float* right, Index count) {
  double sum = 0;
  for (Index i = 0; i < count; ++i) {
    const double apart = static_cast<double>(left[i]) - static_cast<double>(right[i]);
    sum += apart * apart;
  }
  return std::sqrt(sum);
}

double quantile(std::vector<double> numbers, double share) {
  std::sort(numbers.begin(), numbers.end());
  return numbers[static_cast<std::size_t>(share * static_cast<double>(numbers.size() - 1))];
}

/// Distance of answers to a case from the library's at a hundredth of the tolerance, environment by environment.
void judge(Report& report, const RobotCase& robot, const Answer& answer, const std::string& start) {
  const auto batch = robot.jacobians.view();
  const auto expected = solve(batch, RobotSolve(RobotForm::jacobian, SolverKind::automatic, 1e-6).options);
  std::vector<double> apart, residuals, steps(answer.steps.begin(), answer.steps.end());
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset dof = batch.env_dof_offsets[env];
    const Index dofs = batch.env_dofs(env);
    const double moved = norm_of_difference(expected.velocity.data() + dof, batch.v_free + dof, dofs);
    const double other = norm_of_difference(answer.velocity.data() + dof, expected.velocity.data() + dof, dofs);
    apart.push_back(other == 0 ? 0 : other / moved);
  }
  for (const Residual& residual : verify(robot.matrices.view(), std::span<const float>(answer.lambda)))
    residuals.push_back(residual.relative);
  const double most = quantile(apart, 1), median = quantile(apart, 0.5), residual = quantile(residuals, 0.95);
  const std::string part = "answers " + start;
  report.measured(part, [&](JsonLine& line) {
    line.add("envs", batch.env_count).add("velocity_apart", most).add("velocity_apart_median", median);
    line.add("residual_p95", residual).add("residual_median", quantile(residuals, 0.5));
    line.add("steps_median", quantile(steps, 0.5)).add("steps_most", quantile(steps, 1));
  });
  if (most <= kMostApart && median <= kMostApartMedian && residual <= kMostResidual) return report.judge(part, "");
  char what[120];
  std::snprintf(what, sizeof what, "velocities are %.3g of their change apart, %.3g in the median; residual %.3g", most,
                median, residual);
  report.judge(part, what);
}

void compare_baseline(Report& report, const std::string& name) {
  const auto robot = robot_case(report.setting(), name);
  if (!robot) return report.left_out("", "there is no " + name + ".batch in '" + report.setting().batches + "'");
  const bool is_native = report.target() != nullptr && report.target()->is_native();
  const auto with_start = [](Dense& dense, const RobotCase& of, bool is_warm) -> BaselineBatch& {
    dense.view.start = is_warm ? of.velocities.data() : nullptr;
    return dense.view;
  };
  Dense once(robot->jacobians.view());
  const auto there_of = [&](const Dense& dense) {
    return There(*report.target(), dense.view, static_cast<Offset>(dense.J.size()),
                 static_cast<Offset>(dense.M.size()));
  };
  for (const bool is_warm : {false, true}) {
    const BaselineBatch& batch = with_start(once, *robot, is_warm);
    Answer answer;
    if (is_native) {
      There there = there_of(once);
      there.queue();
      answer = there.fetch();
    } else {
      answer = solve_in_a_loop(batch);
    }
    judge(report, *robot, answer, is_warm ? "warm" : "cold");
  }
  if (!is_native) return report.left_out("times", "the baseline is timed on a GPU");
  for (const Offset envs : kSizes) {
    const RobotCase many = repeated(*robot, envs, RobotForm::jacobian);
    Dense dense(many.jacobians.view());
    for (const bool is_warm : {false, true}) {
      with_start(dense, many, is_warm);
      There there = there_of(dense);
      const Time time = time_graph(*report.target(), there.stream(), repeats(report), [&] { there.queue(); });
      const double each = 1e3 * time.median / static_cast<double>(envs);
      const std::string part = std::to_string(envs) + (is_warm ? " warm" : " cold");
      report.measured(part, [&](JsonLine& line) {
        line.add("envs", envs).add("us", time.median).add("us_least", time.least).add("ns_per_env", each);
      });
      report.say(name + " baseline", part + " " + brief(each));
    }
  }
}

}  // namespace

void add_baseline(Checks& checks) {
  // Not piles: they have 180 degrees of freedom, where no peer is dense. Walkers need no recording.
  for (const char* const name : {"g1", "humanoid", "leap_hand", "walkers"})
    checks.push_back({std::string("baseline/") + name, 20, [name](Report& report) { compare_baseline(report, name); }});
}

}  // namespace stiction::gpu_first
