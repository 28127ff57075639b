// Derivatives of the relaxed problem (kappa > 0): against differences of a solver of its own, written from the
// definition, and against answers by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "stiction/error.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"
#include "tests/support/oracles/relaxed_oracle.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

DerivativeOptions relaxed(double kappa) {
  DerivativeOptions options;
  options.kappa = kappa;
  return options;
}

/// Reactions of the exact problem; empty where no method gets there.
std::vector<double> exact(const Environment<double>& env, Law law) {
  const ContactBatch<double> batch = batch_of({env}, law);
  for (const SolverKind solver : {SolverKind::newton, SolverKind::nsgs}) {
    const auto solution = solve(batch, options(solver, 1e-12, solver == SolverKind::newton ? 100 : 20000));
    // Beside a contact that barely opens roundings are more than 1e-12 of its need.
    if (solution.status[0].code == EnvCode::solved || solution.status[0].code == EnvCode::rounding)
      return solution.lambda;
  }
  return {};
}

Environment<double> problem(std::uint64_t seed) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = 1 + static_cast<int>(seed % 3);
  recipe.others = static_cast<int>(seed % 4);
  recipe.compliance = 0.05;
  return random_contacts(recipe);
}

struct Parameter {
  const char* name;
  std::vector<double> Environment<double>::* numbers;
  std::vector<double> Gradients<double>::* gradient;
};
const Parameter kParameters[] = {
    {"A", &Environment<double>::A, &Gradients<double>::A},    {"b", &Environment<double>::b, &Gradients<double>::b},
    {"R", &Environment<double>::R, &Gradients<double>::R},    {"mu", &Environment<double>::mu, &Gradients<double>::mu},
    {"lo", &Environment<double>::lo, &Gradients<double>::lo}, {"hi", &Environment<double>::hi, &Gradients<double>::hi}};

double loss_of(const Environment<double>& env, const std::vector<double>& lambda, const std::vector<double>& lambda_bar,
               const std::vector<double>& w_bar) {
  std::vector<double> reactions(lambda.begin(), lambda.begin() + static_cast<std::ptrdiff_t>(env.b.size()));
  return dot(lambda_bar, reactions) + dot(w_bar, RelaxedOracle::motion(env, reactions));
}

class RelaxedDerivative : public testing::TestWithParam<Law> {};
INSTANTIATE_TEST_SUITE_P(BothLaws, RelaxedDerivative, testing::ValuesIn(kBothLaws),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST_P(RelaxedDerivative, IsThatOfDifferencesOfTheRelaxedProblem) {
  double worst[6] = {};
  int used = 0;
  std::uint64_t draw = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed)
    for (const double kappa : {1e-1, 1e-2}) {
      const Environment<double> env = problem(seed);
      const std::vector<double> lambda = exact(env, GetParam());
      const RelaxedOracle oracle(env, GetParam(), kappa);
      const std::vector<double> base = oracle.solve();
      if (lambda.empty() || base.empty()) continue;
      const std::vector<double> lambda_bar = random_numbers(env.b.size(), ++draw),
                                w_bar = random_numbers(env.b.size(), ++draw);
      const ContactBatch<double> batch = batch_of({env}, GetParam());
      const auto own = vjp(batch.view(), lambda, lambda_bar, w_bar, relaxed(kappa));
      ASSERT_EQ(own.status[0].flags & kGradientRefused, 0U) << seed;
      ++used;
      for (std::size_t p = 0; p < 6; ++p) {
        const std::vector<double>& numbers = env.*kParameters[p].numbers;
        const std::vector<double>& gradient = own.*kParameters[p].gradient;
        std::vector<double> direction = random_numbers(numbers.size(), ++draw);
        for (std::size_t i = 0; i < numbers.size(); ++i)
          direction[i] = std::isfinite(numbers[i]) ? direction[i] * numbers[i] : 0.0;
        constexpr double kStep = 1e-5;
        Environment<double> up = env, down = env;
        double size = 1e-4, slope = 0.0;
        for (std::size_t i = 0; i < numbers.size(); ++i) {
          (up.*kParameters[p].numbers)[i] += kStep * direction[i];
          (down.*kParameters[p].numbers)[i] -= kStep * direction[i];
          slope += gradient[i] * direction[i];
          size += std::abs(gradient[i] * direction[i]);
        }
        const std::vector<double> above = oracle.solve_near(up, base), below = oracle.solve_near(down, base);
        ASSERT_FALSE(above.empty() || below.empty()) << seed;
        const double difference =
            (loss_of(up, above, lambda_bar, w_bar) - loss_of(down, below, lambda_bar, w_bar)) / (2 * kStep);
        worst[p] = std::max(worst[p], std::abs(difference - slope) / size);
      }
    }
  std::printf("%d problems; largest error:", used);
  for (std::size_t p = 0; p < 6; ++p) {
    std::printf(" %s %.1e", kParameters[p].name, worst[p]);
    EXPECT_LT(worst[p], 1e-5) << kParameters[p].name;
  }
  std::printf("\n");
  EXPECT_GE(used, 36);
}

/// A row pressed with b < 0, or open, on A = 2 without compliance: lambda = (sqrt(b² + 4 A kappa) - b) / 2A.
TEST(RelaxedRow, IsTheOneByHandOpenPressedAndAtOnset) {
  constexpr double kA = 2.0, kKappa = 0.03;
  for (const double b : {-3.0, -0.1, 0.0, 0.2, 5.0}) {
    const Environment<double> env = system({unilateral()}, {kA}, {b});
    const ContactBatch<double> batch = batch_of({env});
    const std::vector<double> lambda{std::max(0.0, -b / kA)};
    const double root = std::sqrt(b * b + 4 * kA * kKappa), own = (root - b) / (2 * kA);
    const auto found = vjp(batch.view(), lambda, {1.0}, {}, relaxed(kKappa));
    EXPECT_EQ(found.status[0].flags, 0U);
    EXPECT_NEAR(found.b[0], (b / root - 1) / (2 * kA), 1e-14) << b;
    EXPECT_NEAR(found.R[0], own * found.b[0], 1e-14) << b;
    EXPECT_NEAR(found.A[0], own * found.b[0], 1e-14) << b;
    // An open contact of the exact problem passes nothing on.
    EXPECT_EQ(vjp(batch.view(), lambda, {1.0}, {}).b[0], b < 0 ? -1 / kA : 0.0) << b;
  }
}

/// The error falls with kappa in proportion, as a central path's does.
TEST_P(RelaxedDerivative, TendsToTheExactOneInProportionToKappa) {
  int used = 0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Environment<double> env = problem(seed);
    const std::vector<double> lambda = exact(env, GetParam());
    if (lambda.empty()) continue;
    const ContactBatch<double> batch = batch_of({env}, GetParam());
    const std::vector<double> bar = random_numbers(lambda.size(), seed);
    DerivativeOptions careful;
    careful.tie_tolerance = 0.02;
    const auto wanted = vjp(batch.view(), lambda, bar, {}, careful);
    if (wanted.status[0].flags != 0) continue;
    double error[2] = {};
    for (int k = 0; k < 2; ++k) {
      const auto own = vjp(batch.view(), lambda, bar, {}, relaxed(k == 0 ? 1e-7 : 1e-8));
      ASSERT_EQ(own.status[0].flags & kGradientRefused, 0U);
      for (std::size_t i = 0; i < own.b.size(); ++i) error[k] = std::hypot(error[k], own.b[i] - wanted.b[i]);
    }
    if (error[0] < 1e-9) continue;
    ++used;
    EXPECT_NEAR(error[0] / error[1], 10.0, 1.0) << seed << ": " << error[0] << ", " << error[1];
  }
  EXPECT_GE(used, 10);
}

TEST_P(RelaxedDerivative, ForwardIsTheTransposeOfReverse) {
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Environment<double> env = problem(seed);
    const std::vector<double> lambda = exact(env, GetParam());
    if (lambda.empty()) continue;
    const std::size_t n = lambda.size();
    const ContactBatch<double> batch = batch_of({env}, GetParam());
    const std::vector<double> bar = random_numbers(n, seed), w_bar = random_numbers(n, seed + 1);
    const auto back = vjp(batch.view(), lambda, bar, w_bar, relaxed(1e-3));
    const auto dA = random_numbers(env.A.size(), seed + 2), db = random_numbers(n, seed + 3),
               dR = random_numbers(n, seed + 4), dmu = random_numbers(n, seed + 5), dlo = random_numbers(n, seed + 6),
               dhi = random_numbers(n, seed + 7);
    const auto front =
        jvp(batch.view(), lambda,
            BatchTangentView<double>{dA.data(), nullptr, db.data(), dR.data(), dmu.data(), dlo.data(), dhi.data()},
            relaxed(1e-3));
    const double reverse =
        dot(back.A, dA) + dot(back.b, db) + dot(back.R, dR) + dot(back.mu, dmu) + dot(back.lo, dlo) + dot(back.hi, dhi);
    const double forward = dot(front.lambda, bar) + dot(front.w, w_bar);
    worst = std::max(worst, std::abs(reverse - forward) / (1.0 + std::abs(forward)));
  }
  EXPECT_LT(worst, 1e-10);
}

/// J and M through A = J M^-1 J': the relaxed reactions and velocities are those that J and M see.
TEST_P(RelaxedDerivative, ByJAndMIsThatOfDifferencesOfTheRelaxedProblem) {
  constexpr double kKappa = 1e-2, kStep = 1e-5;
  double worst = 0.0;
  int used = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const JacobianEnvironment<double> env = random_jacobian({seed, 2, 1, 6, 0, 0.05});
    const std::size_t n = env.mu.size(), dofs = env.v_free.size();
    const auto contacts = [&](const JacobianEnvironment<double>& from) {
      const JacobianOracle assembled(from, 0);
      Environment<double> to = system(from.cones, assembled.A, assembled.b);
      to.mu = from.mu;
      to.R = from.R;
      to.lo.assign(n, 0.0);
      to.hi.assign(n, 0.0);
      return to;
    };
    const Environment<double> own = contacts(env);
    const std::vector<double> lambda = exact(own, GetParam());
    const RelaxedOracle oracle(own, GetParam(), kKappa);
    const std::vector<double> base = oracle.solve();
    if (lambda.empty() || base.empty()) continue;
    const auto lambda_bar = random_numbers(n, seed), w_bar = random_numbers(n, seed + 1),
               v_bar = random_numbers(dofs, seed + 2);
    const auto batch = batch_of(env, kForms[0], GetParam());
    const auto found = vjp(batch.view(), lambda, lambda_bar, w_bar, v_bar, relaxed(kKappa));
    ASSERT_EQ(found.status[0].flags & kGradientRefused, 0U);
    ++used;
    const auto loss = [&](const JacobianEnvironment<double>& at) {
      const Environment<double> moved = contacts(at);
      const std::vector<double> reactions = oracle.solve_near(moved, base);
      EXPECT_FALSE(reactions.empty());
      const JacobianOracle assembled(at, 0);
      double sum = loss_of(moved, reactions, lambda_bar, w_bar);
      for (std::size_t k = 0; k < dofs; ++k) {
        double velocity = at.v_free[k];
        for (std::size_t i = 0; i < n; ++i) velocity += assembled.response[k * n + i] * reactions[i];
        sum += v_bar[k] * velocity;
      }
      return sum;
    };
    JacobianEnvironment<double> up = env, down = env;
    double slope = 0.0, size = 0.0;
    std::uint64_t draw = 100 * seed;
    const auto turn = [&](std::vector<double> JacobianEnvironment<double>::* numbers,
                          const std::vector<double>& gradient) {
      std::vector<double> direction = random_numbers((env.*numbers).size(), ++draw);
      if (numbers == &JacobianEnvironment<double>::M)
        for (std::size_t i = 0; i < dofs; ++i)
          for (std::size_t j = 0; j < i; ++j) direction[i * dofs + j] = direction[j * dofs + i];
      for (std::size_t i = 0; i < direction.size(); ++i) {
        if (numbers == &JacobianEnvironment<double>::mu) direction[i] *= env.mu[i];
        (up.*numbers)[i] += kStep * direction[i];
        (down.*numbers)[i] -= kStep * direction[i];
        slope += gradient[i] * direction[i];
        size += std::abs(gradient[i] * direction[i]);
      }
    };
    turn(&JacobianEnvironment<double>::J, found.J);
    turn(&JacobianEnvironment<double>::M, found.M);
    turn(&JacobianEnvironment<double>::v_free, found.v_free);
    turn(&JacobianEnvironment<double>::target, found.target);
    turn(&JacobianEnvironment<double>::R, found.R);
    turn(&JacobianEnvironment<double>::mu, found.mu);
    worst = std::max(worst, std::abs((loss(up) - loss(down)) / (2 * kStep) - slope) / size);
    // Forward along the same changes agrees.
    JacobianGradients<double> change(batch.view());
    for (auto* part : change.parts()) std::fill(part->begin(), part->end(), 0.0);
    for (std::size_t k = 0; k < dofs; ++k) change.v_free[k] = (up.v_free[k] - env.v_free[k]) / kStep;
    for (std::size_t k = 0; k < env.J.size(); ++k) change.J[k] = (up.J[k] - env.J[k]) / kStep;
    JacobianChanges<double> moved(batch.view());
    Derivative(Device::cpu(), relaxed(kKappa))
        .jvp(batch.view(), ReactionView<double>{lambda.data(), nullptr}, change.tangents(), moved.view(),
             moved.status.data());
    const double forward = dot(moved.lambda, lambda_bar) + dot(moved.w, w_bar) + dot(moved.velocity, v_bar);
    EXPECT_NEAR(forward, dot(found.J, change.J) + dot(found.v_free, change.v_free), 1e-10 * (1 + std::abs(forward)));
  }
  std::printf("%d problems, largest error %.1e\n", used, worst);
  EXPECT_LT(worst, 1e-5);
  EXPECT_GE(used, 6);
}

/// A = Y Y' that is not stored has the derivatives of the A that is.
TEST_P(RelaxedDerivative, ThroughAFactorIsThatOfTheMatrix) {
  JacobianBatch<double> jacobian(GetParam());
  jacobian.add(random_jacobian({3, 5, 4, 11, 0}));
  const ContactBatch<double> stored = assemble(jacobian.view(), FactorUse::never),
                             factor = assemble(jacobian.view(), FactorUse::always);
  const auto solution = solve(stored, options(SolverKind::npgs, 1e-8, 20000));
  const auto bar = random_numbers(solution.lambda.size(), 1), w_bar = random_numbers(solution.lambda.size(), 2);
  const auto wanted = vjp(stored.view(), solution.lambda, bar, w_bar, relaxed(1e-3));
  const auto own = vjp(factor.view(), solution.lambda, bar, w_bar, relaxed(1e-3));
  ASSERT_EQ(wanted.status[0].flags & kGradientRefused, 0U);
  ASSERT_EQ(own.status[0].flags & kGradientRefused, 0U);
  for (std::size_t i = 0; i < own.b.size(); ++i) {
    EXPECT_NEAR(own.b[i], wanted.b[i], 1e-8 * (1 + std::abs(wanted.b[i])));
    EXPECT_NEAR(own.mu[i], wanted.mu[i], 1e-8 * (1 + std::abs(wanted.mu[i])));
  }
  // Along a change dY, A changes by dY Y' + Y dY'.
  const auto n = own.b.size(), dofs = own.factor.size() / n;
  const auto& Y = factor.arrays().factor;
  const auto dY = random_numbers(own.factor.size(), 3);
  double along = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t k = 0; k < dofs; ++k)
        along += wanted.A[i * n + j] * (dY[i * dofs + k] * Y[j * dofs + k] + Y[i * dofs + k] * dY[j * dofs + k]);
  EXPECT_NEAR(dot(own.factor, dY), along, 1e-8 * (1 + std::abs(along)));
}

/// The exact derivative jumps where contacts begin. The relaxed one is continuous.
TEST(RelaxedRow, DoesNotJumpWhereAContactBegins) {
  const auto slope = [](double b, double kappa) {
    const Environment<double> env = contact({1.0, 1.0, 1.0}, {b, 0.3, 0.0}, 0.5);
    const ContactBatch<double> batch = batch_of({env}, Law::coulomb);
    const std::vector<double> lambda = exact(env, Law::coulomb);
    EXPECT_FALSE(lambda.empty());
    return vjp(batch.view(), lambda, {1.0, 0.0, 0.0}, {}, relaxed(kappa)).b[0];
  };
  EXPECT_NEAR(slope(1e-5, 0.0) - slope(-1e-5, 0.0), 1.0, 1e-9);
  EXPECT_NEAR(slope(1e-5, 1e-3), slope(-1e-5, 1e-3), 1e-3);
  EXPECT_LT(slope(1e-5, 1e-3), -0.1);
}

/// Single precision: the relaxed problem is solved in double whatever the batch's numbers are.
TEST_P(RelaxedDerivative, InSinglePrecisionIsThatOfDouble) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Environment<double> env = problem(seed);
    const std::vector<double> lambda = exact(env, GetParam());
    if (lambda.empty()) continue;
    const ContactBatch<double> batch = batch_of({env}, GetParam());
    const ContactBatch<float> single = convert<float>(batch);
    const std::vector<double> bar = random_numbers(lambda.size(), seed);
    const std::vector<float> lambda_f(lambda.begin(), lambda.end()), bar_f(bar.begin(), bar.end());
    const auto wanted = vjp(batch.view(), lambda, bar, {}, relaxed(1e-3));
    const auto own = vjp(single.view(), lambda_f, bar_f, {}, relaxed(1e-3));
    EXPECT_EQ(own.status[0].flags & kGradientRefused, 0U);
    double size = 1.0;
    for (const double number : wanted.b) size = std::max(size, std::abs(number));
    for (std::size_t i = 0; i < wanted.b.size(); ++i)
      EXPECT_NEAR(static_cast<double>(own.b[i]), wanted.b[i], 1e-4 * size) << seed;
  }
}

TEST(RelaxedOptions, OutOfRangeIsRefusedByName) {
  const auto said = [](double kappa) {
    try {
      const Derivative derivative(Device::cpu(), relaxed(kappa));
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(said(-1.0).find("kappa = -1"), std::string::npos);
  EXPECT_NE(said(std::numeric_limits<double>::quiet_NaN()).find("kappa = nan"), std::string::npos);
  EXPECT_NE(said(std::numeric_limits<double>::infinity()).find("kappa = inf"), std::string::npos);
  EXPECT_EQ(said(1e-3), "");
}

/// Refusals at kappa = 0 hold, with zeros; an environment beside one keeps its bits.
TEST(RelaxedOptions, WhatHasNoDerivativeGetsZerosAndChangesNoOther) {
  const Environment<double> sound = problem(3);
  const std::vector<double> lambda = exact(sound, Law::convex);
  ASSERT_FALSE(lambda.empty());
  Environment<double> bad = sound;
  bad.b[0] = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> both = lambda, bar = random_numbers(lambda.size(), 1), bars = bar;
  both.insert(both.end(), lambda.begin(), lambda.end());
  bars.insert(bars.end(), bar.begin(), bar.end());
  const ContactBatch<double> alone = batch_of({sound}), beside = batch_of({sound, bad});
  const auto one = vjp(alone.view(), lambda, bar, {}, relaxed(1e-3));
  const auto two = vjp(beside.view(), both, bars, {}, relaxed(1e-3));
  EXPECT_NE(two.status[1].flags & kGradientRefused, 0U);
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    EXPECT_EQ(two.b[i], one.b[i]);
    EXPECT_EQ(two.b[lambda.size() + i], 0.0);
  }
  // Too many unknowns: every row counts here, that of an open contact, too.
  const std::vector<double> open{0.0, 0.0, 0.0};
  const ContactBatch<double> apart = batch_of({contact({1.0, 1.0, 1.0}, {1.0, 0.1, 0.0}, 0.5)});
  DerivativeOptions few = relaxed(1e-3);
  few.max_unknowns = 2;
  EXPECT_EQ(vjp(apart.view(), open, {1.0, 0.0, 0.0}, {}, few).status[0].flags,
            static_cast<std::uint32_t>(kGradientOverCapacity));
  few.max_unknowns = 3;
  EXPECT_EQ(vjp(apart.view(), open, {1.0, 0.0, 0.0}, {}, few).status[0].flags, 0U);
}

}  // namespace
