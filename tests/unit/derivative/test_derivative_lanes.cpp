// Derivatives of compliant environments of J and M, which lanes take side by side. They are compared with those of the
// contact batch that is assembled of them, which takes another linear system.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "cpu_fallback/tables/isa.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/compliant_jacobians.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

std::vector<std::uint8_t> answered(const JacobianBatchView<double>& view, const std::vector<double>& lambda,
                                   const DerivativeOptions& o = {}) {
  JacobianGradients<double> to(view);
  std::vector<double> adjoint(static_cast<std::size_t>(view.dof_count)), moved(adjoint.size());
  JacobianVjpJob<double> job{};
  job.gradients = to.view();
  job.lanes = {adjoint.data(), moved.data(), nullptr};
  return answered_by(cpu::best_isa().velocity().f64.vjp, job, view, lambda, o);
}

TEST(DerivativeInLanes, IsThatOfTheAssembledBatch) {
  constexpr std::uint64_t kEnvs = 60;
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const auto batch = batch_of(draw_all(kEnvs, form), form);
    const auto view = batch.view();
    const auto lambda = solved(batch);
    const auto taken = answered(view, lambda);
    EXPECT_EQ(std::accumulate(taken.begin(), taken.end(), 0), static_cast<int>(kEnvs));
    const auto bar = random_numbers(lambda.size(), 1), w_bar = random_numbers(lambda.size(), 2);
    const auto own = test::vjp(view, lambda, bar, w_bar, {});
    const ContactBatch<double> assembled = assemble(view, FactorUse::never);
    const auto expected = vjp(assembled.view(), lambda, bar, w_bar);
    const auto compare = [&](const char* name, const std::vector<double>& one, const std::vector<double>& other,
                             double sign) {
      const double size = std::max(largest(other), 1e-3);
      for (std::size_t i = 0; i < one.size(); ++i)
        EXPECT_NEAR(one[i], sign * other[i], 1e-9 * size) << name << ' ' << i;
    };
    compare("target", own.target, expected.b, -1.0);
    compare("R", own.R, expected.R, 1.0);
    compare("mu", own.mu, expected.mu, 1.0);
    compare("lo", own.lo, expected.lo, 1.0);
    compare("hi", own.hi, expected.hi, 1.0);
    EXPECT_GT(largest(own.mu), 0.01);
    EXPECT_GT(largest(own.lo), 0.01);
    EXPECT_GT(largest(own.hi), 0.01);
    expect_records_near(own.status, expected.status);
  }
}

TEST(DerivativeInLanes, CountsTheSameContactsBetweenModes) {
  const auto batch = batch_of(draw_all(40));
  const auto view = batch.view();
  const auto lambda = solved(batch);
  const auto bar = random_numbers(lambda.size(), 1);
  int tied = 0;
  for (const double tolerance : {0.0, 1e-2, 0.3}) {
    DerivativeOptions o;
    o.tie_tolerance = tolerance;
    const auto own = test::vjp(view, lambda, bar, {}, {}, o);
    const auto expected = vjp(assemble(view, FactorUse::never).view(), lambda, bar, {}, o);
    for (std::size_t e = 0; e < own.status.size(); ++e) {
      EXPECT_EQ(own.status[e].flags, expected.status[e].flags) << tolerance << ' ' << e;
      EXPECT_EQ(own.status[e].unknowns, expected.status[e].unknowns) << tolerance << ' ' << e;
      EXPECT_EQ(own.status[e].degenerate, expected.status[e].degenerate) << tolerance << ' ' << e;
      tied += own.status[e].degenerate;
    }
  }
  EXPECT_GT(tied, 50);
}

/// Lanes take no row without compliance, no unsolved answer, not more unknowns than allowed, and no factor that is too
/// large. Neighbours of such environments have the bits that they have alone.
TEST(DerivativeInLanes, LeavesTheRestToTheOthers) {
  std::vector<JacobianEnvironment<double>> envs = draw_all(9);
  envs[2].R[0] = 0.0;
  envs[6] = random_jacobian({5, 4, 3, 190, 0, 0.01});
  const auto batch = batch_of(envs);
  const auto view = batch.view();
  auto lambda = solved(batch);
  lambda[static_cast<std::size_t>(view.env_row_offsets[4])] += 1.0;
  const auto taken = answered(view, lambda);
  EXPECT_EQ(taken, (std::vector<std::uint8_t>{1, 1, 0, 1, 0, 1, 0, 1, 1}));
  const auto bar = random_numbers(lambda.size(), 1);
  const auto own = test::vjp(view, lambda, bar, {}, {});
  for (std::size_t e = 0; e < envs.size(); ++e)
    EXPECT_EQ(own.status[e].flags, e == 4 ? std::uint32_t{kGradientUnconverged} : 0U) << e;
  for (Offset i = view.env_row_offsets[4]; i < view.env_row_offsets[5]; ++i)
    EXPECT_EQ(own.R[static_cast<std::size_t>(i)], 0.0);
  for (std::size_t e = 0; e < envs.size(); ++e) {
    const auto alone = batch_of({envs[e]});
    const auto first = static_cast<std::ptrdiff_t>(view.env_row_offsets[static_cast<Offset>(e)]);
    const auto last = static_cast<std::ptrdiff_t>(view.env_row_offsets[static_cast<Offset>(e) + 1]);
    const auto part = [&](const std::vector<double>& numbers) {
      return std::vector<double>(numbers.begin() + first, numbers.begin() + last);
    };
    const auto expected = test::vjp(alone.view(), part(lambda), part(bar), {}, {});
    const auto R = part(own.R);
    EXPECT_TRUE(same_bits(std::span<const double>(R), std::span<const double>(expected.R))) << e;
  }
  DerivativeOptions few;
  few.max_unknowns = 1;
  for (const std::uint8_t one : answered(view, lambda, few)) EXPECT_EQ(one, 0);
}

/// A batch may come without a target.
TEST(DerivativeInLanes, TakesNoTargetForZeros) {
  JacobianEnvironment<double> whole = beside_one_another({draw(3), draw(4), draw(5), draw(6), draw(7), draw(8)});
  std::ranges::fill(whole.target, 0.0);
  const auto batch = batch_of({whole});
  auto view = batch.view();
  const auto lambda = solved(batch);
  const auto bar = random_numbers(lambda.size(), 1);
  const auto expected = test::vjp(view, lambda, bar, {}, {});
  ASSERT_EQ(answered(view, lambda), (std::vector<std::uint8_t>{1}));
  view.target = nullptr;
  const auto own = test::vjp(view, lambda, bar, {}, {});
  EXPECT_TRUE(same_bits(std::span<const double>(own.R), std::span<const double>(expected.R)));
  EXPECT_TRUE(same_bits(std::span<const double>(own.J), std::span<const double>(expected.J)));
  EXPECT_EQ(own.status[0].flags, 0U);
  EXPECT_EQ(own.status[0].forward_residual, expected.status[0].forward_residual);
}

/// Robots beside one another, and one robot: more degrees of freedom than lanes take side by side. Ties and residuals
/// are measured by the whole environment's motion.
TEST(DerivativeInLanes, TakesLargeEnvironmentsPartByPart) {
  int round = 0;
  for (const MassForm form : {MassForm::matrix, MassForm::factor, MassForm::matrix}) {
    const bool is_one = ++round == 3;
    const JacobianEnvironment<double> whole = is_one
                                                  ? random_jacobian({9, 9, 4, 81, 0, 0.02})
                                                  : beside_one_another({draw(3, form), draw(4, form), draw(5, form),
                                                                        draw(6, form), draw(7, form), draw(8, form)});
    const std::size_t dofs = whole.v_free.size();
    ASSERT_GT(dofs, 64U);
    const auto batch = batch_of({draw(2, form), whole, draw(5, form)}, form);
    const auto view = batch.view();
    const auto lambda = solved(batch);
    EXPECT_EQ(answered(view, lambda), (std::vector<std::uint8_t>{1, 1, 1}));
    const auto bar = random_numbers(lambda.size(), 1),
               v_bar = random_numbers(static_cast<std::size_t>(view.dof_count), 2);
    for (const double tolerance : {0.0, 0.1}) {
      DerivativeOptions o;
      o.tie_tolerance = tolerance;
      const auto own = test::vjp(view, lambda, bar, bar, v_bar, o);
      const ContactBatch<double> assembled = assemble(view, FactorUse::never);
      auto seed = bar;
      const auto row = static_cast<std::size_t>(view.env_row_offsets[1]);
      const auto dof = static_cast<std::size_t>(view.env_dof_offsets[1]);
      const std::vector<double> bars(v_bar.begin() + static_cast<std::ptrdiff_t>(dof),
                                     v_bar.begin() + static_cast<std::ptrdiff_t>(dof + dofs));
      const auto response = solve_columns(full_mass_of(whole, form), bars, dofs);
      for (std::size_t i = 0; i < whole.mu.size(); ++i)
        for (std::size_t k = 0; k < dofs; ++k) seed[row + i] += whole.J[i * dofs + k] * response[k];
      const auto expected = vjp(assembled.view(), lambda, seed, bar, o);
      for (std::size_t i = row; i < row + whole.mu.size(); ++i) {
        EXPECT_NEAR(own.target[i], -expected.b[i], 1e-9 * largest(expected.b)) << i;
        EXPECT_NEAR(own.R[i], expected.R[i], 1e-9 * largest(expected.R)) << i;
        EXPECT_NEAR(own.mu[i], expected.mu[i], 1e-9 * largest(expected.mu)) << i;
      }
      EXPECT_EQ(own.status[1].flags, expected.status[1].flags);
      EXPECT_EQ(own.status[1].unknowns, expected.status[1].unknowns);
      EXPECT_EQ(own.status[1].degenerate, expected.status[1].degenerate);
      // Roundings of max|b|, over the scale of an island that is smaller.
      EXPECT_NEAR(own.status[1].forward_residual, expected.status[1].forward_residual, 1e-13);
    }
  }
}

}  // namespace
