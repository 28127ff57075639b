// Derivatives by J, M and v_free: against finite differences of solves, and an adjoint velocity's limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/support/bits.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr double kTightest = 1e-13;

struct Parameter {
  const char* name;
  std::vector<double> JacobianEnvironment<double>::* numbers;
  std::vector<double> JacobianGradients<double>::* gradient;
};
const Parameter kParameters[] = {{"J", &JacobianEnvironment<double>::J, &JacobianGradients<double>::J},
                                 {"M", &JacobianEnvironment<double>::M, &JacobianGradients<double>::M},
                                 {"v_free", &JacobianEnvironment<double>::v_free, &JacobianGradients<double>::v_free},
                                 {"target", &JacobianEnvironment<double>::target, &JacobianGradients<double>::target},
                                 {"R", &JacobianEnvironment<double>::R, &JacobianGradients<double>::R},
                                 {"mu", &JacobianEnvironment<double>::mu, &JacobianGradients<double>::mu}};

TEST(DerivativeOfJacobians, IsThatOfFiniteDifferences) {
  double worst[6] = {}, raw[6] = {};
  int used = 0;
  std::uint64_t draw = 0;
  for (const Law law : kBothLaws)
    for (const Form& form : kForms)
      for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        const JacobianEnvironment<double> env = environment_of(form, seed);
        const auto solution = solved(env, form, law, kTightest);
        if (solution.contact.status[0].code != EnvCode::solved) continue;
        const auto batch = batch_of(env, form, law);
        DerivativeOptions careful;
        careful.tie_tolerance = 1e-3;
        if (vjp(batch.view(), solution.contact.lambda, {}, {}, {}, careful).status[0].flags != 0) continue;
        ++used;
        const std::size_t rows = env.mu.size();
        const auto lambda_bar = random_numbers(rows, ++draw), w_bar = random_numbers(rows, ++draw),
                   v_bar = random_numbers(9, ++draw);
        const auto own = vjp(batch.view(), solution.contact.lambda, lambda_bar, w_bar, v_bar);
        const auto loss = [&](const JacobianEnvironment<double>& at) {
          const auto moved = solved(at, form, law, kTightest);
          return dot(moved.contact.lambda, lambda_bar) + dot(moved.contact.w, w_bar) + dot(moved.velocity, v_bar);
        };
        for (std::size_t p = 0; p < 6; ++p) {
          const std::vector<double>& numbers = env.*kParameters[p].numbers;
          std::vector<double> direction = random_numbers(numbers.size(), ++draw);
          if (p >= 4)
            for (std::size_t i = 0; i < direction.size(); ++i) direction[i] *= numbers[i];
          if (p == 1) restrict_mass(form, direction);
          constexpr double kStep = 3e-6;
          JacobianEnvironment<double> up = env, down = env;
          for (std::size_t i = 0; i < numbers.size(); ++i) {
            (up.*kParameters[p].numbers)[i] += kStep * direction[i];
            (down.*kParameters[p].numbers)[i] -= kStep * direction[i];
          }
          const double difference = (loss(up) - loss(down)) / (2 * kStep);
          const std::vector<double>& gradient = own.*kParameters[p].gradient;
          double size = 1e-6;
          for (std::size_t i = 0; i < direction.size(); ++i) size += std::abs(gradient[i] * direction[i]);
          // A reaction of relative residual r is exact for a b that is r max|b| away (test_derivative.cpp).
          double largest_b = 0.0, sum = 0.0;
          const ContactBatch<double> assembled = assemble(batch.view());
          for (const double b : assembled.arrays().b) largest_b = std::max(largest_b, std::abs(b));
          for (const double nu : own.target) sum += std::abs(nu);
          const double error = std::abs(difference - dot(gradient, direction));
          worst[p] = std::max(worst[p], (error - kTightest * largest_b * sum / kStep) / size);
          if (size > 1e-3) raw[p] = std::max(raw[p], error / size);
        }
      }
  std::printf("%d problems; largest, with noise:", used);
  for (std::size_t p = 0; p < 6; ++p) {
    std::printf(" %s %.2e", kParameters[p].name, raw[p]);
    EXPECT_LT(worst[p], 1e-5) << kParameters[p].name;
  }
  std::printf("\n");
  EXPECT_GE(used, 60);
}

/// Without compliance, and for a loss of velocities, the adjoint velocity moves no row that sticks. It moves a sliding
/// contact along the direction that Coulomb's law leaves free.
TEST(DerivativeOfJacobians, TheAdjointVelocityKeepsWhatContactsHold) {
  const Form form = kForms[0];
  int sticking = 0, sliding = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    JacobianEnvironment<double> env = random_jacobian({seed, 2, 1, 9, 0, 0.0});
    const auto solution = solve(batch_of(env, form, Law::coulomb), options(SolverKind::nsgs, 1e-12, 20000));
    if (solution.contact.status[0].code != EnvCode::solved) continue;
    const auto v_bar = random_numbers(9, seed);
    const auto own = vjp(batch_of(env, form, Law::coulomb).view(), solution.contact.lambda, {}, {}, v_bar);
    if ((own.status[0].flags & kGradientRefused) != 0 || own.status[0].degenerate > 0) continue;
    // M a is the derivative by v_free.
    const auto a = solve_columns(full_mass(env, 0), own.v_free, 9);
    std::vector<double> moved(env.mu.size());
    for (std::size_t i = 0; i < moved.size(); ++i)
      for (std::size_t k = 0; k < 9; ++k) moved[i] += env.J[i * 9 + k] * a[k];
    std::size_t row = 0;
    for (const auto& cone : env.cones) {
      const auto* const lambda = solution.contact.lambda.data() + row;
      const auto* const w = solution.contact.w.data() + row;
      if (lambda[0] > 1e-6) {
        const double speed = cone.row_count == 1 ? 0.0 : std::hypot(w[1], w[2]);
        if (speed < 1e-8) {
          ++sticking;
          for (Index k = 0; k < cone.row_count; ++k) EXPECT_NEAR(moved[row + static_cast<std::size_t>(k)], 0.0, 1e-9);
        } else {
          ++sliding;
          const double mu1 = env.mu[row + 1], mu2 = env.mu[row + 2], all = std::hypot(mu1 * w[1], mu2 * w[2]);
          EXPECT_NEAR(moved[row] - (mu1 * mu1 * w[1] * moved[row + 1] + mu2 * mu2 * w[2] * moved[row + 2]) / all, 0.0,
                      1e-9);
        }
      }
      row += static_cast<std::size_t>(cone.row_count);
    }
  }
  EXPECT_GE(sticking, 15);
  EXPECT_GE(sliding, 15);
}

TEST(DerivativeOfJacobians, WithoutContactsVelocitiesAreTheFreeOnes) {
  JacobianEnvironment<double> env = random_jacobian({1, 0, 0, 4, 0, 0.0});
  const std::vector<double> v_bar{1, -2, 3, 4};
  const auto own = vjp(batch_of(env, kForms[0], Law::convex).view(), {}, {}, {}, v_bar);
  EXPECT_EQ(own.status[0].flags, 0U);
  EXPECT_EQ(own.v_free, v_bar);
  for (const double number : own.M) EXPECT_EQ(number, 0.0);
}

TEST(DerivativeOfJacobians, ABrokenMassGetsZerosAndLeavesOthersAlone) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  JacobianBatch<double> sound(Law::coulomb), broken(Law::coulomb);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    JacobianEnvironment<double> env = random_jacobian({seed, 2, 2, 6, 0, 0.01});
    sound.add(env);
    if (seed == 2) env.M[0] = -1;
    broken.add(env);
  }
  const auto solution = solve(sound, options(SolverKind::newton, 1e-12, 100));
  const auto& lambda = solution.contact.lambda;
  const auto v_bar = random_numbers(18, 1);
  const auto expected = vjp(sound.view(), lambda, lambda, {}, v_bar);
  const auto check = [&](const JacobianGradients<double>& own, std::uint32_t flag) {
    EXPECT_NE(own.status[1].flags & flag, 0U);
    const auto view = sound.view();
    const auto part = [&](const std::vector<double>& one, const std::vector<double>& other, const auto& begin) {
      for (Offset e = 0; e < 3; ++e)
        for (Offset i = begin(e); i < begin(e + 1); ++i)
          EXPECT_EQ(one[static_cast<std::size_t>(i)], e == 1 ? 0.0 : other[static_cast<std::size_t>(i)]);
    };
    const auto row = [&](Offset e) { return view.env_row_offsets[e]; };
    part(own.J, expected.J, [&](Offset e) { return view.row_offsets[row(e)]; });
    part(own.M, expected.M, [&](Offset e) { return view.env_mass_offsets[e]; });
    part(own.v_free, expected.v_free, [&](Offset e) { return view.env_dof_offsets[e]; });
    for (const auto member :
         {&JacobianGradients<double>::target, &JacobianGradients<double>::R, &JacobianGradients<double>::mu,
          &JacobianGradients<double>::lo, &JacobianGradients<double>::hi})
      part(own.*member, expected.*member, row);
  };
  check(vjp(broken.view(), lambda, lambda, {}, v_bar), kGradientInvalidInput);
  std::vector<double> bad = v_bar;
  bad[7] = kNan;
  check(vjp(sound.view(), lambda, lambda, {}, bad), kGradientNonFinite);
  bad = lambda;
  bad[static_cast<std::size_t>(sound.view().env_row_offsets[1])] = kNan;
  check(vjp(sound.view(), bad, lambda, {}, v_bar), kGradientNonFinite);
}

}  // namespace
