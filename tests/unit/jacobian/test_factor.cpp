#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/plan/plan.hpp"
#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// A large environment between two small ones: 84 rows on 20 degrees of freedom.
JacobianBatch<double> mixed(Law law, double compliance = 0.01) {
  JacobianBatch<double> batch(law);
  batch.add(random_jacobian({1, 2, 2, 6, 0, compliance}));
  batch.add(random_jacobian({2, 25, 9, 20, 0, compliance}));
  batch.add(random_jacobian({3, 3, 1, 9, 0, compliance}));
  return batch;
}

TEST(Factor, IsChosenByRowsAndDegreesOfFreedomAlone) {
  static_assert(!prefers_factor(72, 1) && prefers_factor(73, 18) && !prefers_factor(73, 19));
  static_assert(!prefers_factor(76, 19) && !prefers_factor(100, 0));
  const auto batch = assemble(mixed(Law::convex).view(), FactorUse::by_size);
  const PlanData plan = make_plan(batch.view());
  EXPECT_EQ(plan.path, (std::vector<EnvPath>{EnvPath::dense, EnvPath::factor, EnvPath::dense}));
  EXPECT_EQ(plan.factor_order, std::vector<Offset>{1});
  EXPECT_TRUE(validate(batch.view()).empty());
}

TEST(Factor, FormsTheSameMatrix) {
  const auto jacobian = mixed(Law::convex);
  const auto matrix = assemble(jacobian.view(), FactorUse::never),
             factor = assemble(jacobian.view(), FactorUse::always);
  EXPECT_EQ(matrix.arrays().b, factor.arrays().b);
  const auto factors = factor.view(), matrices = matrix.view();
  for (Offset env = 0; env < factors.env_count; ++env) {
    const Index n = factors.env_rows(env), dofs = factors.env_dofs(env);
    EXPECT_EQ(dofs, jacobian.view().env_dofs(env));
    const double* Y = factors.factor + factors.factor_offsets[env];
    for (Index i = 0; i < n; ++i)
      for (Index j = 0; j < n; ++j) {
        double sum = 0.0;
        for (Index k = 0; k < dofs; ++k) sum += Y[i * dofs + k] * Y[j * dofs + k];
        EXPECT_NEAR(sum, matrices.A[matrices.row_offsets[matrices.env_row_offsets[env] + i] + j], 1e-13);
      }
  }
}

TEST(Factor, EveryMethodFindsTheMotionThatItFindsOnTheMatrix) {
  for (const Law law : kBothLaws)
    for (const SolverKind kind : kAllSolvers) {
      SCOPED_TRACE(label(kind, law));
      // Jacobi without momentum needs a system of moderate condition to come that far at all.
      const auto jacobian = mixed(law, kind == SolverKind::jacobi ? 1.0 : 0.01);
      SolverOptions o = options(kind, 1e-9, 40000);
      const auto dense = solve(jacobian, o, Device::cpu(), {}, FactorUse::never);
      const auto factor = solve(jacobian, o, Device::cpu(), {}, FactorUse::always);
      const auto dense_judged =
          verify(assemble(jacobian.view(), FactorUse::never).view(), std::span<const double>(factor.contact.lambda));
      for (std::size_t e = 0; e < 3; ++e) {
        EXPECT_EQ(dense.contact.status[e].code, EnvCode::solved);
        EXPECT_EQ(factor.contact.status[e].code, EnvCode::solved) << "after " << factor.contact.status[e].iterations;
        EXPECT_LE(dense_judged[e].relative, 1.001e-9) << "judged on the matrix";
      }
      double largest = 0.0;
      for (const double v : dense.velocity) largest = std::max(largest, std::abs(v));
      EXPECT_LT(largest_difference(dense.velocity, factor.velocity), 1e-6 * largest);
    }
}

TEST(Factor, TheJudgeSeesTheSameResidualAndMotion) {
  const auto jacobian = mixed(Law::coulomb);
  const auto matrix = assemble(jacobian.view(), FactorUse::never),
             factor = assemble(jacobian.view(), FactorUse::always);
  std::vector<double> lambda;
  for (Offset i = 0; i < matrix.row_count(); ++i) lambda.push_back(std::cos(static_cast<double>(i)));
  const auto expected = verify(matrix.view(), std::span<const double>(lambda));
  const auto actual = verify(factor.view(), std::span<const double>(lambda));
  for (std::size_t e = 0; e < expected.size(); ++e)
    EXPECT_NEAR(actual[e].absolute, expected[e].absolute, 1e-12 * (1 + expected[e].absolute));
  // A solve's report of its own answer is the judge's.
  const auto solution = solve(factor, options(SolverKind::pgs, 0, 30));
  const auto judged = verify(factor.view(), std::span<const double>(solution.lambda));
  for (std::size_t e = 0; e < judged.size(); ++e)
    EXPECT_NEAR(solution.status[e].residual_absolute, judged[e].absolute, 1e-12 * (1 + judged[e].absolute));
}

TEST(Factor, NeighboursThreadsAndOrderReachNoBit) {
  const auto batch = convert<float>(assemble(mixed(Law::convex).view(), FactorUse::by_size));
  SolverOptions o = options(SolverKind::npgs, 1e-4, 200);
  const auto together = solve(batch, o);
  o.threads = 3;
  EXPECT_TRUE(same_bits(together, solve(batch, o)));
  const std::vector<Offset> order{1};
  const auto alone = solve(gather(batch, std::span<const Offset>(order)), o);
  const auto first = static_cast<std::size_t>(batch.arrays().env_row_offsets[1]);
  EXPECT_TRUE(same_bits(std::span<const float>(alone.lambda),
                        std::span<const float>(together.lambda).subspan(first, alone.lambda.size())));
}

TEST(Factor, PoisonIsFlaggedWhereItIs) {
  auto arrays = assemble(mixed(Law::convex).view(), FactorUse::always).arrays();
  arrays.factor[static_cast<std::size_t>(arrays.factor_offsets[1]) + 7] = std::numeric_limits<double>::quiet_NaN();
  const auto batch = ContactBatch<double>::from_arrays(Law::convex, arrays);
  const auto defects = validate(batch.view());
  ASSERT_EQ(defects.size(), 1U);
  EXPECT_EQ(defects[0].env, 1);
  EXPECT_EQ(defects[0].message.rfind("factor[env 1", 0), 0U) << defects[0].message;
  SolverOptions o = options(SolverKind::apgd, 1e-6, 500);
  o.invalid = InvalidPolicy::isolate;
  const auto solution = solve(batch, o);
  EXPECT_EQ(solution.status[1].code, EnvCode::invalid_input);
  EXPECT_NE(solution.status[1].flags & kFlagNonFiniteInput, 0U);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[2].code, EnvCode::solved);
}

TEST(Factor, ADeviceGivesTheCpusBits) {
  const auto jacobian = mixed(Law::convex);
  ASSERT_FALSE(assemble(jacobian.view()).arrays().factor.empty()) << "kept by size unless told otherwise";
  const auto here = solve(jacobian, options(SolverKind::npgs, 1e-6, 100));
  const auto there = solve(jacobian, options(SolverKind::npgs, 1e-6, 100), Device::emulated());
  EXPECT_TRUE(same_bits(here.contact, there.contact));
  EXPECT_TRUE(same_bits(std::span<const double>(here.velocity), std::span<const double>(there.velocity)));
}

TEST(Factor, OffsetsThatFitNoRowsAreStructuralDefects) {
  auto arrays = assemble(mixed(Law::convex).view(), FactorUse::always).arrays();
  arrays.factor_offsets[1] += 1;
  const auto defects = validate(ContactBatch<double>::from_arrays(Law::convex, arrays).view());
  ASSERT_FALSE(defects.empty());
  EXPECT_TRUE(defects[0].structural);
  EXPECT_NE(defects[0].message.find("factor"), std::string::npos) << defects[0].message;
}

// A = Y Y' of two free rows. Rows that share a degree of freedom are of one island, others are not.
TEST(Factor, IslandsOfAFactorAreThoseOfSharedDegreesOfFreedom) {
  for (const double shared : {0.0, 1.0}) {
    ContactBatch<double>::Arrays arrays;
    arrays.env_row_offsets = {0, 2};
    arrays.env_cone_offsets = {0, 2};
    arrays.cone_kind = {ConeKind::free, ConeKind::free};
    arrays.cone_row_offsets = {0, 1, 2};
    arrays.row_offsets = {0, 0, 0};
    arrays.b = {-1, -4};
    arrays.R = arrays.mu = arrays.lo = arrays.hi = {0, 0};
    arrays.factor_offsets = {0, 4};
    arrays.factor = {1, 0, shared, 1};
    const auto batch = ContactBatch<double>::from_arrays(Law::convex, arrays);
    const std::vector<double> lambda{0, 2};
    const Residual residual = verify(batch.view(), std::span<const double>(lambda)).at(0);
    EXPECT_EQ(residual.cone, 0);
    EXPECT_EQ(residual.scale, shared > 0 ? 4 : 1);
  }
}

}  // namespace
