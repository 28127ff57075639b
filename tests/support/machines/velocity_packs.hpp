#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "core/algorithm/velocity/evaluate/velocity_result.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "cpu_fallback/pack/lane_packs.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/scoped_isa.hpp"

/// Newton's method in velocities by the library's kernels: which environments share a pack is the caller's choice.
namespace stiction::test {

template <class Real>
struct Answers {
  std::vector<Real> lambda, w, velocity;
  std::vector<EnvStatus> status;
  std::vector<std::uint8_t> answered;
};

template <class Real>
Answers<Real> no_answers(const JacobianBatchView<Real>& batch) {
  Answers<Real> answers;
  answers.lambda.assign(static_cast<std::size_t>(batch.row_count), Real(-7));
  answers.w = answers.lambda;
  answers.velocity.assign(static_cast<std::size_t>(batch.dof_count), Real(-7));
  answers.status.resize(static_cast<std::size_t>(batch.env_count));
  answers.answered.assign(static_cast<std::size_t>(batch.env_count), 9);
  return answers;
}

template <class Real>
VelocityJob<Real> job_of(const JacobianBatchView<Real>& batch, double tolerance, const JacobianStart<Real>& start,
                         Answers<Real>& answers) {
  VelocityJob<Real> job;
  job.batch = batch;
  job.law = batch.law;
  job.tolerance = tolerance;
  job.max_iterations = 100;
  job.warm_start = start.reactions;
  job.warm_velocity = start.velocities;
  job.to = {answers.lambda.data(), answers.w.data(), answers.velocity.data(), answers.status.data()};
  job.answered = answers.answered.data();
  return job;
}

/// Environments of a batch in that order, `count` of which solve(job, members, count) gets at a time.
template <class Real, class Solve>
Answers<Real> solve_in_groups(const JacobianBatch<Real>& batch, const std::vector<Offset>& order, std::size_t count,
                              double tolerance, const JacobianStart<Real>& start, const Solve& solve) {
  const JacobianBatchView<Real> view = batch.view();
  Answers<Real> answers = no_answers(view);
  const VelocityJob<Real> job = job_of(view, tolerance, start, answers);
  for (std::size_t at = 0; at < order.size(); at += count) {
    std::vector<LaneEnv<Real>> members;
    std::vector<VelocityResult> results(std::min(count, order.size() - at));
    for (std::size_t i = 0; i < results.size(); ++i) {
      members.push_back(lane_env(view, order[at + i]));
      members.back().result = &results[i];
    }
    solve(job, members);
    for (std::size_t i = 0; i < results.size(); ++i) finish(job, order[at + i], results[i]);
  }
  return answers;
}

/// Memory of a worker that is written over before it is used: nothing may be taken from its earlier contents.
class OverwrittenScratch {
 public:
  cpu::VelocityScratch& overwritten() {
    std::memset(scratch_.lists.reserve<char>(kBytes), 0xff, kBytes);
    std::fill_n(numbers(), kNumbers, std::numeric_limits<double>::quiet_NaN());
    return scratch_;
  }
  /// Returns true if anything was written into the numbers since.
  bool is_used() {
    return std::any_of(numbers(), numbers() + kNumbers, [](double x) { return !std::isnan(x); });
  }

 private:
  static constexpr Offset kNumbers = 1 << 17, kBytes = 1 << 20;
  double* numbers() { return scratch_.numbers.reserve<double>(kNumbers); }
  cpu::VelocityScratch scratch_;
};

/// By the library's kernels of one build, which make a pack of `count` environments.
template <class Real>
Answers<Real> solve_by(const cpu::Isa& isa, std::size_t count, const JacobianBatch<Real>& batch,
                       const std::vector<Offset>& order, double tolerance, const JacobianStart<Real>& start = {}) {
  const cpu::VelocityKernelSet set = isa.velocity();
  const cpu::VelocityKernels<Real>& kernels = cpu::of_precision<Real>(set);
  OverwrittenScratch scratch;
  return solve_in_groups(batch, order, count, tolerance, start, [&](const auto& job, const auto& members) {
    kernels.solve(job, members.data(), static_cast<Offset>(members.size()), scratch.overwritten());
    EXPECT_TRUE(scratch.is_used());
  });
}

/// Each environment by itself.
template <class Real>
Answers<Real> solve_one_by_one(const JacobianBatch<Real>& batch, const std::vector<Offset>& order, double tolerance,
                               const JacobianStart<Real>& start = {}) {
  return solve_by(cpu::best_isa(), 1, batch, order, tolerance, start);
}

/// Each by itself, as one of more degrees of freedom than a word has bits is.
inline Answers<double> solve_with_large_sets(const JacobianBatch<double>& batch, const std::vector<Offset>& order,
                                             double tolerance) {
  using Large = LaneTypes<double, 1, LargeDofSet>;
  OverwrittenScratch scratch;
  return solve_in_groups(batch, order, 1, tolerance, {}, [&](const auto& job, const auto& members) {
    solve_pack<Large>(job, members.data(), 1, PackMemory<Large>{scratch.overwritten()});
  });
}

/// As many as fill a pack of the build's vectors, in which steps of Number go. The library makes none of two
/// environments: of three it makes one and leaves one over.
template <class Number, class Real>
Answers<Real> solve_in_packs(const cpu::Isa& isa, const JacobianBatch<Real>& batch, const std::vector<Offset>& order,
                             double tolerance, const JacobianStart<Real>& start = {}) {
  const Index width = cpu::of_precision<Number>(isa.velocity()).width;
  return solve_by(isa, static_cast<std::size_t>(std::max<Index>(width, 3)), batch, order, tolerance, start);
}

/// The builds of the library that have packs: of 2, 4 and 8 doubles where there is AVX2.
inline std::vector<const cpu::Isa*> builds_with_packs() {
  std::vector<const cpu::Isa*> builds;
  for (const char* name : usable_isas())
    if (const cpu::Isa* isa = cpu::find_isa(name); isa->velocity().f64.width > 1) builds.push_back(isa);
  return builds;
}

template <class Real>
void expect_the_same(const Answers<Real>& expected, const Answers<Real>& actual) {
  EXPECT_EQ(expected.answered, actual.answered);
  EXPECT_TRUE(same_bits(std::span<const Real>(expected.lambda), std::span<const Real>(actual.lambda)));
  EXPECT_TRUE(same_bits(std::span<const Real>(expected.w), std::span<const Real>(actual.w)));
  EXPECT_TRUE(same_bits(std::span<const Real>(expected.velocity), std::span<const Real>(actual.velocity)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(actual.status)));
}

}  // namespace stiction::test
