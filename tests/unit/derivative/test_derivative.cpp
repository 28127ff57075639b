// Derivatives of reactions: against finite differences of solves, and against the natural map differentiated as a
// whole.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "stiction/residual.hpp"
#include "tests/support/oracles/natural_map_derivative.hpp"
#include "tests/support/systems/derivative_cases.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr double kTightest = 1e-13;

/// The reactions, as exact as doubles have them; empty where no method gets there.
std::vector<double> solved(const Environment<double>& env, Law law, const std::vector<double>& guess = {}) {
  const ContactBatch<double> batch = batch_of({env}, law);
  for (const SolverKind solver : {SolverKind::newton, SolverKind::nsgs}) {
    const auto solution = solve(batch, options(solver, kTightest, solver == SolverKind::newton ? 100 : 20000),
                                Device::cpu(), std::span<const double>(guess));
    if (solution.status[0].code == EnvCode::solved) return solution.lambda;
  }
  return {};
}

/// A problem that has an answer which does not change its modes at a small step.
struct Case {
  Environment<double> env;
  Law law;
  std::vector<double> lambda;
};

std::vector<Case> cases(Law law, int wanted) {
  std::vector<Case> found;
  for (std::uint64_t seed = 1; static_cast<int>(found.size()) < wanted && seed < 2000; ++seed) {
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 1 + static_cast<int>(seed % 4);
    recipe.others = static_cast<int>(seed % 5);
    recipe.compliance = 0.05;
    recipe.mu_max = seed % 2 == 0 ? 1.0 : 4.0;
    const Environment<double> env = random_contacts(recipe);
    const std::vector<double> lambda = solved(env, law);
    if (lambda.empty()) continue;
    const ContactBatch<double> batch = batch_of({env}, law);
    DerivativeOptions careful;
    careful.tie_tolerance = 1e-3;
    const auto status = vjp(batch.view(), lambda, {}, {}, careful).status[0];
    if (status.flags == 0) found.push_back({env, law, lambda});
  }
  return found;
}

/// Counts of contacts that stick, slide and are open.
std::array<int, 3> modes(const Case& one) {
  std::array<int, 3> count{};
  std::size_t row = 0;
  for (const auto& cone : one.env.cones) {
    if (cone.kind == ConeKind::friction) {
      double share = 0.0;
      for (std::size_t i = row + 1; i < row + static_cast<std::size_t>(cone.row_count); ++i)
        if (one.env.mu[i] > 0.0) share = std::hypot(share, one.lambda[i] / one.env.mu[i]);
      const double normal = one.lambda[row];
      ++count[normal < 1e-9 ? 2 : share > normal * (1 - 1e-9) ? 1 : 0];
    }
    row += static_cast<std::size_t>(cone.row_count);
  }
  return count;
}

double loss(const Environment<double>& env, Law law, const std::vector<double>& guess,
            const std::vector<double>& lambda_bar, const std::vector<double>& w_bar) {
  const std::vector<double> lambda = solved(env, law, guess);
  EXPECT_FALSE(lambda.empty());
  if (lambda.empty()) return 0.0;
  double sum = dot(lambda, lambda_bar);
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    double w = env.b[i] + env.R[i] * lambda[i];
    for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
         ++k)
      w += env.A[k] * lambda[static_cast<std::size_t>(env.column[k])];
    sum += w * w_bar[i];
  }
  return sum;
}

/// One array of an environment and its gradient.
struct Parameter {
  const char* name;
  std::vector<double> Environment<double>::* numbers;
  std::vector<double> Gradients<double>::* gradient;
};
const Parameter kParameters[] = {
    {"A", &Environment<double>::A, &Gradients<double>::A},    {"b", &Environment<double>::b, &Gradients<double>::b},
    {"R", &Environment<double>::R, &Gradients<double>::R},    {"mu", &Environment<double>::mu, &Gradients<double>::mu},
    {"lo", &Environment<double>::lo, &Gradients<double>::lo}, {"hi", &Environment<double>::hi, &Gradients<double>::hi}};

/// A change of all numbers in proportion to their size, so that none changes sign. One that is zero keeps it.
std::vector<double> direction_of(const std::vector<double>& numbers, std::uint64_t seed) {
  std::vector<double> direction = random_numbers(numbers.size(), seed);
  for (std::size_t i = 0; i < numbers.size(); ++i)
    direction[i] = std::isfinite(numbers[i]) ? direction[i] * numbers[i] : 0.0;
  return direction;
}

/// Keeps A symmetric, which the forward methods ask for: an entry changes as its transpose does.
void symmetrise(const Environment<double>& env, std::vector<double>& direction) {
  const auto n = static_cast<std::size_t>(env.b.size());
  std::vector<double> dense(n * n);
  const auto each = [&](auto&& f) {
    for (std::size_t i = 0; i < n; ++i)
      for (auto k = static_cast<std::size_t>(env.row_offsets[i]); k < static_cast<std::size_t>(env.row_offsets[i + 1]);
           ++k)
        f(dense[i * n + static_cast<std::size_t>(env.column[k])],
          dense[static_cast<std::size_t>(env.column[k]) * n + i], k);
  };
  each([&](double& entry, double&, std::size_t k) { entry = direction[k]; });
  each([&](double& entry, double& other, std::size_t k) { direction[k] = 0.5 * (entry + other); });
}

/// Distance of the loss from that of an exact answer, over the step, for both ends. A reaction of relative residual r
/// is exact for a b that is r max|b| away.
double noise(const Environment<double>& env, const std::vector<double>& nu, double step) {
  double size = 0.0, sum = 0.0;
  for (const double b : env.b) size = std::max(size, std::abs(b));
  for (const double number : nu) sum += std::abs(number);
  return kTightest * size * sum / step;
}

/// Largest of (|error| - noise) / (sum of |gradient * direction|) over cases, by parameter.
void compare_with_differences(Law law) {
  std::array<int, 3> seen{};
  double worst[6] = {}, raw[6] = {};
  const auto all = cases(law, 120);
  ASSERT_EQ(all.size(), 120U);
  std::uint64_t seed = 0;
  for (const Case& one : all) {
    const auto found = modes(one);
    for (std::size_t k = 0; k < 3; ++k) seen[k] += found[k];
    const std::vector<double> lambda_bar = random_numbers(one.lambda.size(), ++seed);
    const std::vector<double> w_bar = random_numbers(one.lambda.size(), ++seed);
    const ContactBatch<double> batch = batch_of({one.env}, law);
    const auto gradients = vjp(batch.view(), one.lambda, lambda_bar, w_bar);
    ASSERT_EQ(gradients.status[0].flags, 0U);
    EXPECT_LT(gradients.status[0].residual, 1e-9);
    for (std::size_t p = 0; p < 6; ++p) {
      const Parameter& parameter = kParameters[p];
      std::vector<double> direction = direction_of(one.env.*parameter.numbers, ++seed);
      if (p == 0) symmetrise(one.env, direction);
      constexpr double kStep = 1e-5;
      const auto moved = [&](double step) {
        Environment<double> env = one.env;
        std::vector<double>& numbers = env.*parameter.numbers;
        for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] += direction[i] == 0.0 ? 0.0 : step * direction[i];
        return loss(env, law, one.lambda, lambda_bar, w_bar);
      };
      const double difference = (moved(kStep) - moved(-kStep)) / (2 * kStep);
      const std::vector<double>& gradient = gradients.*parameter.gradient;
      double size = 1e-6;
      for (std::size_t i = 0; i < direction.size(); ++i) size += std::abs(gradient[i] * direction[i]);
      const double error = std::abs(difference - dot(gradient, direction));
      worst[p] = std::max(worst[p], (error - noise(one.env, gradients.b, kStep)) / size);
      if (size > 1e-3) raw[p] = std::max(raw[p], error / size);
    }
  }
  std::string text = std::string(to_string(law)) + ": stick " + std::to_string(seen[0]) + ", slide " +
                     std::to_string(seen[1]) + ", open " + std::to_string(seen[2]) + "; largest, with noise:";
  for (std::size_t p = 0; p < 6; ++p) {
    text += std::string(" ") + kParameters[p].name + " " + std::to_string(raw[p] * 1e6) + "e-6";
    EXPECT_LT(worst[p], 1e-5) << kParameters[p].name;
  }
  std::printf("%s\n", text.c_str());
  for (const int count : seen) EXPECT_GE(count, (seen[0] + seen[1] + seen[2]) / 10);
}

TEST(Derivative, IsThatOfFiniteDifferencesUnderTheConvexLaw) {
  compare_with_differences(Law::convex);
}
TEST(Derivative, IsThatOfFiniteDifferencesUnderCoulombsLaw) {
  compare_with_differences(Law::coulomb);
}

double largest_of(const std::vector<double>& numbers) {
  double largest = 0.0;
  for (const double number : numbers) largest = std::max(largest, std::abs(number));
  return largest;
}

TEST(Derivative, IsThatOfTheNaturalMapAsAWhole) {
  for (const Law law : kBothLaws) {
    double worst = 0.0;
    for (const Case& one : cases(law, 200)) {
      const std::vector<double> lambda_bar = random_numbers(one.lambda.size(), 5);
      const std::vector<double> w_bar = random_numbers(one.lambda.size(), 6);
      const auto batch = batch_of({one.env}, law);
      const auto own = vjp(batch.view(), one.lambda, lambda_bar, w_bar);
      const auto other = NaturalMapDerivative(one.env, law, one.lambda).vjp(lambda_bar, w_bar);
      std::vector<double> stored;
      const std::size_t n = one.lambda.size();
      for (std::size_t i = 0; i < n; ++i)
        for (auto k = one.env.row_offsets[i]; k < one.env.row_offsets[i + 1]; ++k)
          stored.push_back(other.A[i * n + static_cast<std::size_t>(one.env.column[static_cast<std::size_t>(k)])]);
      const auto compare = [&](const std::vector<double>& a, const std::vector<double>& b) {
        worst = std::max(worst, largest_difference(a, b) / std::max(1.0, largest_of(b)));
      };
      compare(own.A, stored);
      compare(own.b, other.b);
      compare(own.R, other.R);
      compare(own.mu, other.mu);
      compare(own.lo, other.lo);
      compare(own.hi, other.hi);
    }
    std::printf("%s: natural map %.2e\n", to_string(law), worst);
    EXPECT_LT(worst, 1e-8) << to_string(law);
  }
}

/// In single precision all is computed in double from the same numbers, so that only the result is rounded.
TEST(Derivative, InSinglePrecisionIsThatOfTheSameNumbersRounded) {
  for (const Law law : kBothLaws)
    for (const Case& one : cases(law, 60)) {
      const ContactBatch<float> batch = convert<float>(batch_of({one.env}, law));
      const auto round = [](const std::vector<double>& numbers) {
        return std::vector<float>(numbers.begin(), numbers.end());
      };
      const auto widen = [](const std::vector<float>& numbers) {
        return std::vector<double>(numbers.begin(), numbers.end());
      };
      const auto lambda = round(one.lambda), lambda_bar = round(random_numbers(lambda.size(), 1)),
                 w_bar = round(random_numbers(lambda.size(), 2));
      const auto own = vjp(batch.view(), lambda, lambda_bar, w_bar);
      const ContactBatch<double> wide = convert<double>(batch);
      const auto expected = vjp(wide.view(), widen(lambda), widen(lambda_bar), widen(w_bar));
      EXPECT_EQ(own.status[0].flags, 0U);
      EXPECT_EQ(own.all(), round(expected.all()));
    }
}

TEST(Derivative, ForwardAndReverseAreTransposes) {
  for (const Law law : kBothLaws)
    for (const Case& one : cases(law, 60)) {
      const auto batch = batch_of({one.env}, law);
      const auto view = batch.view();
      const std::size_t n = one.lambda.size();
      const auto lambda_bar = random_numbers(n, 1), w_bar = random_numbers(n, 2);
      const auto own = vjp(view, one.lambda, lambda_bar, w_bar);
      const auto dA = random_numbers(own.A.size(), 3), db = random_numbers(n, 4), dR = random_numbers(n, 5),
                 dmu = random_numbers(n, 6), dlo = random_numbers(n, 7), dhi = random_numbers(n, 8);
      const auto changes =
          jvp(view, one.lambda,
              BatchTangentView<double>{dA.data(), nullptr, db.data(), dR.data(), dmu.data(), dlo.data(), dhi.data()});
      const auto& [lambda, w, status] = changes;
      EXPECT_EQ(status[0].flags, 0U);
      EXPECT_LT(status[0].residual, 1e-9);
      const double forward = dot(lambda, lambda_bar) + dot(w, w_bar);
      const double reverse =
          dot(own.A, dA) + dot(own.b, db) + dot(own.R, dR) + dot(own.mu, dmu) + dot(own.lo, dlo) + dot(own.hi, dhi);
      double size = 0.0;
      for (std::size_t i = 0; i < n; ++i) size += std::abs(lambda[i] * lambda_bar[i]) + std::abs(w[i] * w_bar[i]);
      EXPECT_NEAR(forward, reverse, 1e-9 * size);
    }
}

}  // namespace
