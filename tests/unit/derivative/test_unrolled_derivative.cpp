// Derivatives of sweeps as they run: against differences of solves by the library with so many iterations.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <string>

#include "stiction/error.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Returns the result of the library's own sweeps.
std::vector<double> swept(const Environment<double>& env, Law law, const std::vector<double>& guess, Index sweeps,
                          double omega = 1.0) {
  SolverOptions own = options(SolverKind::pgs, 0.0, sweeps);
  own.omega = omega;
  return solve(batch_of({env}, law), own, Device::cpu(), std::span<const double>(guess)).lambda;
}

struct Unrolled : Gradients<double> {
  std::vector<double> lambda, by_warm_start;
};

Unrolled unrolled(const ContactBatchView<double>& batch, const std::vector<double>& guess, Index sweeps, double omega,
                  const std::vector<double>& lambda_bar, const std::vector<double>& w_bar,
                  const DerivativeOptions& options = {}) {
  const auto rows = static_cast<std::size_t>(batch.row_count);
  const auto room = [](Offset size) { return std::vector<double>(static_cast<std::size_t>(size), 77.0); };
  Unrolled to;
  to.A = room(batch.nonzero_count);
  to.factor = room(batch.factor_count);
  to.b = to.R = to.mu = to.lo = to.hi = to.lambda = to.by_warm_start = std::vector<double>(rows, 77.0);
  to.status.resize(static_cast<std::size_t>(batch.env_count));
  SweepsView<double> view;
  view.warm_start = guess.empty() ? nullptr : guess.data();
  view.count = sweeps;
  view.omega = omega;
  view.lambda = to.lambda.data();
  view.by_warm_start = to.by_warm_start.data();
  Derivative(Device::cpu(), options)
      .unrolled_vjp(batch, view, {lambda_bar.data(), w_bar.empty() ? nullptr : w_bar.data()}, to.view(),
                    to.status.data());
  return to;
}

/// Rows of A that share no body, in a ring: sparse, so that sweeps go by colours.
Environment<double> ring(std::uint64_t seed) {
  constexpr std::size_t kContacts = 24, kRows = 3 * kContacts;
  scenes::Rng rng(seed);
  Environment<double> env;
  std::vector<double> A(kRows * kRows, 0.0);
  for (std::size_t c = 0; c < kContacts; ++c) {
    env.cones.push_back(friction(3));
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t i = 3 * c + k, j = (i + 3) % kRows;
      A[i * kRows + i] += 2.0 + rng.uniform(0.0, 1.0);
      A[i * kRows + j] = A[j * kRows + i] = rng.symmetric(0.8);
      if (k > 0) A[3 * c * kRows + i] = A[i * kRows + 3 * c] = rng.symmetric(0.5);
      env.b.push_back(rng.symmetric(1.0) - (k == 0 ? 0.6 : 0.0));
      env.R.push_back(0.05);
      env.mu.push_back(k == 0 ? 0.0 : rng.uniform(0.2, 0.8));
      env.lo.push_back(0.0);
      env.hi.push_back(0.0);
    }
  }
  env.row_offsets = {0};
  for (std::size_t i = 0; i < kRows; ++i) {
    for (std::size_t j = 0; j < kRows; ++j)
      if (A[i * kRows + j] != 0.0) {
        env.A.push_back(A[i * kRows + j]);
        env.column.push_back(static_cast<Index>(j));
      }
    env.row_offsets.push_back(static_cast<Index>(env.A.size()));
  }
  return env;
}

struct Parameter {
  const char* name;
  std::vector<double> Environment<double>::* numbers;
  std::vector<double> Unrolled::* gradient;
};
const Parameter kParameters[] = {
    {"A", &Environment<double>::A, &Unrolled::A},     {"b", &Environment<double>::b, &Unrolled::b},
    {"R", &Environment<double>::R, &Unrolled::R},     {"mu", &Environment<double>::mu, &Unrolled::mu},
    {"lo", &Environment<double>::lo, &Unrolled::lo},  {"hi", &Environment<double>::hi, &Unrolled::hi},
    {"warm start", nullptr, &Unrolled::by_warm_start}};

std::vector<double> motion(const Environment<double>& env, const std::vector<double>& lambda) {
  std::vector<double> w = env.b;
  for (std::size_t i = 0; i < w.size(); ++i) {
    w[i] += env.R[i] * lambda[i];
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      w[i] += env.A[k] * lambda[static_cast<std::size_t>(env.column[k])];
  }
  return w;
}

/// The largest error against central differences, for each parameter. Sweeps are not smooth if the two one-sided
/// differences differ; such a change is counted and left out.
struct Comparison {
  double worst[7] = {};
  int used = 0, left_out = 0;

  void add(const Environment<double>& env, Law law, Index sweeps, double omega, std::uint64_t seed) {
    const std::size_t n = env.b.size();
    const std::vector<double> guess = random_numbers(n, seed), lambda_bar = random_numbers(n, seed + 1),
                              w_bar = random_numbers(n, seed + 2);
    const auto own = unrolled(batch_of({env}, law).view(), guess, sweeps, omega, lambda_bar, w_bar);
    ASSERT_EQ(own.status[0].flags, 0U);
    const std::vector<double> answer = swept(env, law, guess, sweeps, omega);
    for (std::size_t i = 0; i < n; ++i) ASSERT_NEAR(own.lambda[i], answer[i], 1e-11 * (1.0 + std::abs(answer[i])));
    const auto loss = [&](const Environment<double>& at, const std::vector<double>& from) {
      const std::vector<double> lambda = swept(at, law, from, sweeps, omega);
      return dot(lambda, lambda_bar) + dot(motion(at, lambda), w_bar);
    };
    const double here = loss(env, guess);
    for (std::size_t p = 0; p < 7; ++p) {
      const std::vector<double>& numbers = kParameters[p].numbers == nullptr ? guess : env.*kParameters[p].numbers;
      std::vector<double> direction = random_numbers(numbers.size(), seed + 3 + p);
      for (std::size_t i = 0; i < numbers.size(); ++i)
        direction[i] = std::isfinite(numbers[i]) ? direction[i] * numbers[i] : 0.0;
      const std::vector<double>& gradient = own.*kParameters[p].gradient;
      constexpr double kStep = 1e-6;
      double end[2], slope = 0.0, size = 1e-3;
      for (int side = 0; side < 2; ++side) {
        Environment<double> moved = env;
        std::vector<double> from = guess;
        std::vector<double>& changed = kParameters[p].numbers == nullptr ? from : moved.*kParameters[p].numbers;
        for (std::size_t i = 0; i < numbers.size(); ++i) changed[i] += (side == 0 ? kStep : -kStep) * direction[i];
        end[side] = loss(moved, from);
      }
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        slope += gradient[i] * direction[i];
        size += std::abs(gradient[i] * direction[i]);
      }
      const double up = (end[0] - here) / kStep, down = (here - end[1]) / kStep;
      if (std::abs(up - down) > 1e-3 * size) {
        ++left_out;
        continue;
      }
      ++used;
      worst[p] = std::max(worst[p], std::abs(0.5 * (up + down) - slope) / size);
    }
  }
  void expect(double limit, int least) const {
    std::printf("%d compared, %d left out; largest error:", used, left_out);
    for (std::size_t p = 0; p < 7; ++p) {
      std::printf(" %s %.1e", kParameters[p].name, worst[p]);
      EXPECT_LT(worst[p], limit) << kParameters[p].name;
    }
    std::printf("\n");
    EXPECT_GE(used, least);
    EXPECT_LE(left_out, used / 20);
  }
};

class UnrolledDerivative : public testing::TestWithParam<Law> {};
INSTANTIATE_TEST_SUITE_P(BothLaws, UnrolledDerivative, testing::ValuesIn(kBothLaws),
                         [](const auto& test) { return std::string(to_string(test.param)); });

/// Dense environments, in canonical order: cones of every kind and size, axes without friction, bounds that are not.
TEST_P(UnrolledDerivative, IsThatOfDifferencesOfSoManySweeps) {
  Comparison found;
  for (std::uint64_t seed = 1; seed <= 12; ++seed)
    for (const Index sweeps : {0, 1, 2, 3, 5, 8}) {
      Recipe recipe;
      recipe.seed = seed;
      recipe.contacts = 1 + static_cast<int>(seed % 3);
      recipe.others = static_cast<int>(seed % 4);
      found.add(random_contacts(recipe), GetParam(), sweeps, seed % 2 == 0 ? 1.0 : 0.8, 100 * seed);
    }
  found.expect(1e-5, 450);
}

/// Steps so long that the last iterate is not the best: the solver returns an earlier one, and of that it is.
TEST_P(UnrolledDerivative, IsThatOfTheIterateThatTheSolverReturns) {
  Comparison found;
  int earlier = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    const Environment<double> env = random_contacts(recipe);
    const std::vector<double> guess = random_numbers(env.b.size(), 100 * seed);
    if (swept(env, GetParam(), guess, 5, 1.95) == swept(env, GetParam(), guess, 4, 1.95)) ++earlier;
    found.add(env, GetParam(), 5, 1.95, 100 * seed);
  }
  std::printf("%d of 24 returned an earlier one; ", earlier);
  found.expect(1e-5, 150);
  EXPECT_GE(earlier, 2);
}

/// Sparse environments, by colours.
TEST_P(UnrolledDerivative, IsThatOfSweepsByColours) {
  Comparison found;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) found.add(ring(seed), GetParam(), 3, 1.0, 100 * seed);
  found.expect(1e-5, 15);
}

/// A = Y Y' that is not stored, in the batch's order.
TEST_P(UnrolledDerivative, IsThatOfSweepsThroughAFactor) {
  JacobianBatch<double> jacobian(GetParam());
  jacobian.add(random_jacobian({3, 5, 4, 11, 0}));
  const ContactBatch<double> batch = assemble(jacobian.view(), FactorUse::always);
  const auto n = static_cast<std::size_t>(batch.row_count());
  const std::vector<double> guess = random_numbers(n, 1), bar = random_numbers(n, 2);
  const auto own = unrolled(batch.view(), guess, 3, 1.0, bar, {});
  ASSERT_EQ(own.status[0].flags, 0U);
  const auto at = [&](double step, const std::vector<double>& direction) {
    auto arrays = batch.arrays();
    for (std::size_t k = 0; k < direction.size(); ++k) arrays.factor[k] += step * direction[k];
    const auto moved = ContactBatch<double>::from_arrays(GetParam(), arrays);
    return solve(moved, options(SolverKind::pgs, 0.0, 3), Device::cpu(), std::span<const double>(guess)).lambda;
  };
  const std::vector<double> direction = random_numbers(own.factor.size(), 3);
  const std::vector<double> answer = at(0.0, direction);
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(own.lambda[i], answer[i], 1e-11);
  const double difference = (dot(at(1e-6, direction), bar) - dot(at(-1e-6, direction), bar)) / 2e-6;
  EXPECT_NEAR(difference, dot(own.factor, direction), 1e-5 * (1 + std::abs(difference)));
}

/// One row pressed by b = -1 on A = 2: a sweep reaches the answer, and forgets where it began.
TEST(UnrolledRow, IsTheOneByHand) {
  const Environment<double> env = system({unilateral()}, {2.0}, {-1.0});
  const ContactBatch<double> batch = batch_of({env});
  const auto own = unrolled(batch.view(), {3.0}, 1, 0.5, {1.0}, {});
  // x - omega (2 x - 1) / 2 = 3 - 0.5 * 2.5
  EXPECT_EQ(own.lambda[0], 1.75);
  EXPECT_EQ(own.b[0], -0.25);
  EXPECT_EQ(own.by_warm_start[0], 0.5);
  // d/dA of x - omega (A x + b) / A = omega b / A²
  EXPECT_EQ(own.A[0], -0.125);
}

/// After many sweeps it is the derivative of the solution.
TEST_P(UnrolledDerivative, TendsToTheImplicitOne) {
  int used = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 2;
    recipe.compliance = 0.3;
    const Environment<double> env = random_contacts(recipe);
    const ContactBatch<double> batch = batch_of({env}, GetParam());
    const std::vector<double> bar = random_numbers(env.b.size(), seed);
    const auto own = unrolled(batch.view(), {}, 400, 1.0, bar, {});
    DerivativeOptions careful;
    careful.tie_tolerance = 1e-3;
    careful.residual_limit = 1e-11;
    const auto wanted = vjp(batch.view(), own.lambda, bar, {}, careful);
    if (wanted.status[0].flags != 0) continue;
    ++used;
    for (std::size_t i = 0; i < bar.size(); ++i) {
      EXPECT_NEAR(own.b[i], wanted.b[i], 1e-7) << seed;
      EXPECT_NEAR(own.mu[i], wanted.mu[i], 1e-7) << seed;
      EXPECT_NEAR(own.by_warm_start[i], 0.0, 1e-7) << seed;
    }
  }
  EXPECT_GE(used, 5);
}

TEST(UnrolledOptions, WhatCannotBeHadIsRefused) {
  const Environment<double> env = contact({1.0, 1.0, 1.0}, {-1.0, 0.1, 0.0}, 0.5);
  const ContactBatch<double> batch = batch_of({env});
  const std::vector<double> bar{1.0, 0.0, 0.0};
  const auto said = [&](const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(said([&] { unrolled(batch.view(), {}, -1, 1.0, bar, {}); }).find("sweeps.count = -1"), std::string::npos);
  EXPECT_NE(said([&] { unrolled(batch.view(), {}, 1, 2.0, bar, {}); }).find("sweeps.omega = 2"), std::string::npos);
  // Numbers that forbid a solve, and rows beyond the room: zeros and a flag.
  Environment<double> bad = env;
  bad.b[1] = std::numeric_limits<double>::quiet_NaN();
  const auto refused = unrolled(batch_of({bad}).view(), {}, 2, 1.0, bar, {});
  EXPECT_NE(refused.status[0].flags & kGradientRefused, 0U);
  for (const auto* part : {&refused.A, &refused.b, &refused.R, &refused.mu, &refused.lambda, &refused.by_warm_start})
    for (const double number : *part) EXPECT_EQ(number, 0.0);
  DerivativeOptions small;
  small.max_unknowns = 2;
  const auto large = unrolled(batch.view(), {}, 2, 1.0, bar, {}, small);
  EXPECT_EQ(large.status[0].flags, static_cast<std::uint32_t>(kGradientOverCapacity));
  EXPECT_EQ(large.b[0], 0.0);
}

}  // namespace
