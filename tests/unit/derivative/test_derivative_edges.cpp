// Derivatives by hand, and where there are none: ties, redundant contacts, nothing to differentiate, misuse.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "stiction/error.hpp"
#include "stiction/jacobian.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/error_message.hpp"
#include "tests/support/systems/derivative_cases.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::Pointwise;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Gradients<double> vjp_of(const Environment<double>& env, Law law, const std::vector<double>& lambda,
                         const std::vector<double>& lambda_bar, const DerivativeOptions& options = {}) {
  return vjp(batch_of({env}, law).view(), lambda, lambda_bar, {}, options);
}

void expect_near(const std::vector<double>& expected, const std::vector<double>& actual) {
  EXPECT_THAT(actual, Pointwise(DoubleNear(1e-14), expected));
}

TEST(DerivativeEdges, ASlidingContactByHand) {
  const Environment<double> env = contact({1, 1, 1}, {-2, 3, 0}, 0.5);
  // lambda_n = -b_n, lambda_1 = -mu lambda_n, and the second tangent turns the motion: -1/2 (d lambda_2 + db_2).
  const auto coulomb = vjp_of(env, Law::coulomb, {2, -1, 0}, {1, 1, 1});
  EXPECT_EQ(coulomb.status[0].flags, 0U);
  EXPECT_EQ(coulomb.status[0].unknowns, 2);
  expect_near({-0.5, 0, -1.0 / 3}, coulomb.b);
  expect_near({0, -2, 0}, coulomb.mu);
  expect_near({-1, 0, 0}, coulomb.R);
  expect_near({-1, 0, 0}, coulomb.A);
  // lambda_n = (-b_n + mu b_1) / (1 + mu^2), whose derivative by mu is 0.16.
  const auto convex = vjp_of(env, Law::convex, {2.8, -1.4, 0}, {1, 1, 1});
  expect_near({-0.4, 0.2, -7.0 / 15}, convex.b);
  expect_near({0, 0.16 - 2.88, 0}, convex.mu);
}

TEST(DerivativeEdges, StickingOpenAndBoundedRowsByHand) {
  Environment<double> env = system({free_row(), unilateral(), unilateral(), box(), box(), box()},
                                   diagonal({2, 4, 1, 1, 1, 2}), {1, -2, 3, -5, 5, 1});
  env.lo = {0, 0, 0, -1, -1, -1};
  env.hi = {0, 0, 0, 1, 1, 1};
  const auto own = vjp_of(env, Law::convex, {-0.5, 0.5, 0, 1, -1, -0.5}, {1, 1, 1, 1, 1, 1});
  EXPECT_EQ(own.status[0].flags, 0U);
  expect_near({-0.5, -0.25, 0, 0, 0, -0.5}, own.b);
  expect_near({0, 0, 0, 1, 0, 0}, own.hi);
  expect_near({0, 0, 0, 0, 1, 0}, own.lo);
  // A contact that sticks, coupled: lambda = -A^-1 b, and friction does not matter.
  const Environment<double> stuck = contact({2, 4, 5}, {-2, 0.4, 0}, 0.5);
  const auto sticking = vjp_of(stuck, Law::coulomb, {1, -0.1, 0}, {1, 1, 1});
  expect_near({-0.5, -0.25, -0.2}, sticking.b);
  expect_near({0, 0, 0}, sticking.mu);
}

TEST(DerivativeEdges, ABranchThatIsNotStableIsFlagged) {
  // lambda_n - 3/2 lambda_n + b_n = 0: pressing the contact on makes its reaction less.
  Environment<double> env = system({friction(2)}, {1, 1.5, 1.5, 4}, {0.1, 1});
  env.mu = {0, 1};
  const auto own = vjp_of(env, Law::coulomb, {0.2, -0.2}, {1, 0});
  EXPECT_EQ(own.status[0].flags, kGradientUnstableBranch);
  expect_near({2, 0}, own.b);
  const auto stable = vjp_of(env, Law::coulomb, {0, 0}, {1, 0});
  EXPECT_EQ(stable.status[0].flags, 0U);
  expect_near({0, 0}, stable.b);
}

TEST(DerivativeEdges, RedundantContactsGetZerosUnlessTheyYield) {
  Environment<double> env = system({unilateral(), unilateral()}, {1, 1, 1, 1}, {-1, -1});
  const auto hard = vjp_of(env, Law::convex, {0.5, 0.5}, {1, 0});
  EXPECT_EQ(hard.status[0].flags, kGradientSingular);
  expect_near({0, 0}, hard.b);
  expect_near({0, 0, 0, 0}, hard.A);
  env.R = {1e-6, 1e-6};
  const double shared = 1 / (2 + 1e-6);
  const auto soft = vjp_of(env, Law::convex, {shared, shared}, {1, 1});
  EXPECT_EQ(soft.status[0].flags, 0U);
  EXPECT_NEAR(soft.b[0], -shared, 1e-9);
}

/// A row's unit reaches no decision: the same redundant pair, one row a thousand million times the other.
TEST(DerivativeEdges, WhatIsRedundantDoesNotDependOnUnits) {
  for (const double unit : {1e-9, 1.0, 1e9}) {
    const Environment<double> env = system({free_row(), free_row()}, {1, unit, unit, unit * unit}, {-1, -unit});
    EXPECT_EQ(vjp_of(env, Law::convex, {1, 0}, {1, 1}).status[0].flags, kGradientSingular) << unit;
    const Environment<double> sound =
        system({free_row(), free_row()}, {1, 0.5 * unit, 0.5 * unit, unit * unit}, {-1, -0.5 * unit});
    EXPECT_EQ(vjp_of(sound, Law::convex, {1, 0}, {1, 1}).status[0].flags, 0U) << unit;
  }
}

TEST(DerivativeEdges, TiesAreCountedAndGoToTheWeakerMode) {
  const auto one = [](const Environment<double>& env, std::vector<double> lambda) {
    const auto own = vjp_of(env, Law::coulomb, lambda, std::vector<double>(lambda.size(), 1.0));
    EXPECT_EQ(own.status[0].flags, kGradientSubgradient);
    EXPECT_EQ(own.status[0].degenerate, 1);
    for (const double number : own.all()) EXPECT_TRUE(std::isfinite(number));
    return own;
  };
  // A contact that just touches beside a row that moves.
  expect_near({0, -1}, one(system({unilateral(), free_row()}, diagonal({1, 1}), {0, -3}), {0, 3}).b);
  // A contact at the edge of its cone that does not slide sticks.
  expect_near({-1, -1, -1}, one(contact({1, 1, 1}, {-2, 1, 0}, 0.5), {2, -1, 0}).b);
  // A cone in its corner, at rest, is open.
  Environment<double> corner = system({friction(3), free_row()}, diagonal({1, 1, 1, 1}), {0, 0, 0, -3});
  corner.mu = {0, 0.5, 0.5, 0};
  expect_near({0, 0, 0, -1}, one(corner, {0, 0, 0, 3}).b);
  // A box row that its bound holds without force is free.
  Environment<double> held = system({box()}, {1}, {-1});
  held.lo = {-1};
  held.hi = {1};
  expect_near({-1}, one(held, {1}).b);
  // All at rest: every cone is between modes.
  const auto rest = vjp_of(contact({1, 1, 1}, {0, 0, 0}, 0.5), Law::convex, {0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(rest.status[0].flags, kGradientSubgradient);
  expect_near({0, 0, 0}, rest.b);
}

TEST(DerivativeEdges, PowersOfTwoChangeNoDecisionAndNoBit) {
  const Environment<double> env = contact({1, 1.3, 1.7}, {-2, 3, 0.25}, 0.5);
  const auto solution = solve(batch_of({env}, Law::coulomb), options(SolverKind::nsgs, 1e-14, 2000));
  const auto own = vjp_of(env, Law::coulomb, solution.lambda, {1, 1, 1});
  for (const double scale : {0x1p-40, 0x1p30}) {
    Environment<double> scaled = env;
    std::vector<double> lambda = solution.lambda;
    for (double& number : scaled.b) number *= scale;
    for (double& number : lambda) number *= scale;
    const auto other = vjp_of(scaled, Law::coulomb, lambda, {1, 1, 1});
    EXPECT_TRUE(same_bits(std::span<const double>(own.b), std::span<const double>(other.b)));
    EXPECT_EQ(other.status[0].flags, own.status[0].flags);
    EXPECT_EQ(other.status[0].residual, own.status[0].residual);
  }
}

TEST(DerivativeEdges, ContactsWithoutFrictionAreRows) {
  for (const Law law : kBothLaws) {
    const auto own = vjp_of(contact({2, 1, 1}, {-2, 3, 1}, 0.0), law, {1, 0, 0}, {1, 1, 1});
    EXPECT_EQ(own.status[0].flags, 0U);
    expect_near({-0.5, 0, 0}, own.b);
    expect_near({0, 0, 0}, own.mu);
  }
}

TEST(DerivativeEdges, NothingToDifferentiate) {
  const auto none = vjp(batch_of({}).view(), std::vector<double>{}, {}, {});
  EXPECT_TRUE(none.status.empty());
  Environment<double> row = system({free_row()}, {2}, {1});
  const auto own = vjp(batch_of({{}, row, {}}).view(), {-0.5}, {1.0}, {});
  expect_near({-0.5}, own.b);
  for (const GradientStatus& status : own.status) EXPECT_EQ(status.flags, 0U);
  // No sets: records alone.
  const auto records = vjp(batch_of({row}).view(), {-0.5}, {}, {}, {}, nullptr, 0);
  EXPECT_EQ(records.status[0].unknowns, 1);
}

TEST(DerivativeEdges, WhatIsRefusedGetsZerosAndAFlag) {
  const Environment<double> env = contact({1, 1, 1}, {-2, 3, 0}, 0.5);
  const std::vector<double> lambda{2, -1, 0}, ones{1, 1, 1};
  const auto expect_refused = [](const Gradients<double>& own, std::uint32_t flag, const char* what) {
    EXPECT_NE(own.status[0].flags & flag, 0U) << what;
    for (const double number : own.all()) EXPECT_EQ(number, 0.0) << what;
  };
  const auto changed = [&](const std::function<void(Environment<double>&)>& change) {
    Environment<double> other = env;
    other.R = {0, 0, 0};
    change(other);
    return vjp_of(other, Law::coulomb, lambda, ones);
  };
  expect_refused(vjp_of(env, Law::coulomb, {2.1, -1, 0}, ones), kGradientUnconverged, "a residual above the limit");
  expect_refused(vjp_of(env, Law::coulomb, {kNan, -1, 0}, ones), kGradientNonFinite, "NaN in lambda");
  expect_refused(vjp_of(env, Law::coulomb, lambda, {1, kNan, 1}), kGradientNonFinite, "NaN in the cotangent");
  expect_refused(vjp_of(env, Law::coulomb, lambda, {1, 1, HUGE_VAL}), kGradientNonFinite, "infinity there");
  expect_refused(changed([](auto& e) { e.A[0] = kNan; }), kGradientNonFinite, "NaN in A");
  expect_refused(changed([](auto& e) { e.b[2] = kNan; }), kGradientNonFinite, "NaN in b");
  expect_refused(changed([](auto& e) { e.R[2] = kNan; }), kGradientNonFinite, "NaN in R");
  expect_refused(changed([](auto& e) { e.mu[1] = kNan; }), kGradientInvalidInput, "NaN in mu");
  expect_refused(changed([](auto& e) { e.mu[1] = -1; }), kGradientInvalidInput, "mu < 0");
  expect_refused(changed([](auto& e) { e.R[1] = -1e-9; }), kGradientInvalidInput, "R < 0");
  DerivativeOptions small;
  small.max_unknowns = 1;
  expect_refused(vjp_of(env, Law::coulomb, lambda, ones, small), kGradientOverCapacity, "two unknowns");
  const ContactBatch<double> batch = batch_of({env}, Law::coulomb);
  EnvStatus status{};
  status.code = EnvCode::max_iterations;
  expect_refused(vjp(batch.view(), lambda, ones, {}, {}, &status), kGradientUnconverged, "not solved");
  status.code = EnvCode::solved;
  EXPECT_EQ(vjp(batch.view(), lambda, ones, {}, {}, &status).status[0].flags, 0U);
  const std::uint32_t bad = kFlagBadMass;
  ContactBatchView<double> view = batch.view();
  view.env_flags = &bad;
  expect_refused(vjp(view, lambda, ones, {}), kGradientInvalidInput, "flags of the batch");
}

TEST(DerivativeEdges, ASetThatIsNoNumberLeavesTheOthersAlone) {
  const ContactBatch<double> batch = batch_of({contact({1, 1, 1}, {-2, 3, 0}, 0.5)}, Law::coulomb);
  const std::vector<double> lambda{2, -1, 0}, bars{1, 1, 1, 1, kNan, 1, 0.5, 0.25, 0.125};
  const auto all = vjp(batch.view(), lambda, bars, {}, {}, nullptr, 3);
  EXPECT_EQ(all.status[0].flags, kGradientNonFinite);
  for (const std::size_t set : {0U, 2U}) {
    const auto own = vjp(batch.view(), lambda, {bars.begin() + 3 * set, bars.begin() + 3 * set + 3}, {});
    EXPECT_TRUE(same_bits(std::span<const double>(own.b), std::span(all.b).subspan(3 * set, 3)));
    EXPECT_TRUE(same_bits(std::span<const double>(own.A), std::span(all.A).subspan(3 * set, 3)));
    EXPECT_TRUE(same_bits(std::span<const double>(own.mu), std::span(all.mu).subspan(3 * set, 3)));
  }
  EXPECT_THAT(std::vector<double>(all.b.begin() + 3, all.b.begin() + 6), ElementsAre(0, 0, 0));
}

TEST(DerivativeEdges, AFactorHasTheDerivativeOfItsMatrix) {
  for (const Law law : kBothLaws) {
    JacobianBatch<double> jacobian(law);
    for (std::uint64_t seed = 1; seed < 9; ++seed) jacobian.add(random_jacobian({seed, 3, 2, 5, 0}));
    const auto matrix = assemble(jacobian.view(), FactorUse::never),
               factor = assemble(jacobian.view(), FactorUse::always);
    const auto solution = solve(matrix, options(SolverKind::newton, 1e-12, 100));
    const auto lambda_bar = random_numbers(solution.lambda.size(), 1),
               w_bar = random_numbers(solution.lambda.size(), 2);
    const auto one = vjp(matrix.view(), solution.lambda, lambda_bar, w_bar);
    const auto two = vjp(factor.view(), solution.lambda, lambda_bar, w_bar);
    const auto near = [](const std::vector<double>& a, const std::vector<double>& b) {
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-8 * (1 + std::abs(a[i])));
    };
    near(one.b, two.b);
    near(one.R, two.R);
    near(one.mu, two.mu);
    // A = Y Y': the derivative by Y is (A_bar + A_bar') Y.
    const auto view = factor.view();
    std::vector<double> expected(two.factor.size());
    for (Offset env = 0; env < view.env_count; ++env) {
      const auto n = static_cast<std::size_t>(view.env_rows(env)), dofs = static_cast<std::size_t>(view.env_dofs(env));
      const auto entry = static_cast<std::size_t>(matrix.view().row_offsets[view.env_row_offsets[env]]);
      const auto begin = static_cast<std::size_t>(view.factor_offsets[env]);
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j < n; ++j)
          for (std::size_t k = 0; k < dofs; ++k)
            expected[begin + i * dofs + k] +=
                (one.A[entry + i * n + j] + one.A[entry + j * n + i]) * view.factor[begin + j * dofs + k];
    }
    near(expected, two.factor);
    // Forward, along the same change.
    const auto change = random_numbers(two.factor.size(), 9);
    std::vector<double> lambda(solution.lambda.size()), w(solution.lambda.size());
    std::vector<GradientStatus> status(static_cast<std::size_t>(view.env_count));
    Derivative().jvp(view, ReactionView<double>{solution.lambda.data(), nullptr},
                     BatchTangentView<double>{nullptr, change.data(), nullptr, nullptr, nullptr, nullptr, nullptr},
                     SolutionTangentView<double>{lambda.data(), w.data()}, status.data());
    EXPECT_NEAR(dot(two.factor, change), dot(lambda, lambda_bar) + dot(w, w_bar), 1e-8);
  }
}

TEST(DerivativeEdges, NumbersThatAreNotInUseAreNotWritten) {
  // Two environments of one row in room for two, and a normal that comes last.
  Environment<double> env = contact({1, 1, 1}, {-2, 3, 0}, 0.5);
  const ContactBatch<double> batch = batch_of({env}, Law::coulomb);
  const auto expected = vjp(batch.view(), {2, -1, 0}, {1, 1, 1}, {});
  ContactBatchView<double> view = batch.view();
  const double b[] = {3, 0, -2}, mu[] = {0.5, 0.5, 0};
  view.b = b;
  view.mu = mu;
  view.normal_last = true;
  const auto turned = vjp(view, {-1, 0, 2}, {1, 1, 1}, {});
  expect_near({expected.b[1], expected.b[2], expected.b[0]}, turned.b);
  expect_near({expected.mu[1], expected.mu[2], expected.mu[0]}, turned.mu);

  const Offset rows[] = {0, 2, 4}, cones[] = {0, 2, 4}, cone_rows[] = {0, 1, 2, 3, 4}, entries[] = {0, 1, 2, 3, 4};
  const Index in_use[] = {1, 1}, row_counts[] = {1, 0, 1, 0}, column[] = {0, 9, 0, 9};
  const ConeKind kind[] = {ConeKind::free, ConeKind::free, ConeKind::free, ConeKind::free};
  const double A[] = {2, kNan, 4, kNan}, one[] = {1, kNan, 1, kNan}, zero[] = {0, kNan, 0, kNan};
  ContactBatchView<double> padded;
  padded.env_count = 2;
  padded.cone_count = padded.row_count = padded.nonzero_count = 4;
  padded.env_row_offsets = rows;
  padded.env_cone_offsets = cones;
  padded.env_row_counts = padded.env_cone_counts = in_use;
  padded.cone_kind = kind;
  padded.cone_row_offsets = cone_rows;
  padded.row_offsets = entries;
  padded.row_counts = row_counts;
  padded.column = column;
  padded.A = A;
  padded.b = one;
  padded.R = padded.mu = padded.lo = padded.hi = zero;
  const auto own = vjp(padded, {-0.5, kNan, -0.25, kNan}, {1, kNan, 1, kNan}, {});
  EXPECT_THAT(own.b, ElementsAre(-0.5, 77, -0.25, 77));
  EXPECT_THAT(own.A, ElementsAre(0.25, 77, 0.0625, 77));
  EXPECT_THAT(own.R, ElementsAre(0.25, 77, 0.0625, 77));
}

TEST(DerivativeEdges, MisuseIsRefusedBeforeAnythingIsWritten) {
  const ContactBatch<double> batch = batch_of({contact({1, 1, 1}, {-2, 3, 0}, 0.5)}, Law::coulomb);
  std::vector<double> lambda{2, -1, 0}, bar{1, 1, 1}, b(3, 77.0);
  GradientStatus status{};
  const auto call = [&](const ContactBatchView<double>& view, const double* at, const double* lambda_bar, double* to,
                        GradientStatus* record, Offset count = 1) {
    BatchCotangentView<double> gradients;
    gradients.b = to;
    return error_message([&] {
      Derivative().vjp(view, ReactionView<double>{at, nullptr}, SolutionCotangentView<double>{lambda_bar, nullptr},
                       gradients, record, count);
    });
  };
  using testing::HasSubstr;
  const auto view = batch.view();
  EXPECT_THAT(call(view, lambda.data(), bar.data(), lambda.data(), &status), HasSubstr("gradients.b and at.lambda"));
  EXPECT_THAT(call(view, lambda.data(), bar.data(), bar.data(), &status), HasSubstr("cotangents.lambda"));
  EXPECT_THAT(call(view, lambda.data(), bar.data(), const_cast<double*>(view.b), &status), HasSubstr("batch.b"));
  EXPECT_THAT(call(view, nullptr, bar.data(), b.data(), &status), HasSubstr("at.lambda is null"));
  EXPECT_THAT(call(view, lambda.data(), bar.data(), b.data(), nullptr), HasSubstr("status is null"));
  EXPECT_THAT(call(view, lambda.data(), bar.data(), b.data(), &status, -1), HasSubstr("count = -1"));
  ContactBatchView<double> broken = view;
  broken.mu = nullptr;
  EXPECT_THAT(call(broken, lambda.data(), bar.data(), b.data(), &status), HasSubstr("batch.mu is null"));
  broken = view;
  broken.space = MemorySpace::cuda;
  EXPECT_THAT(call(broken, lambda.data(), bar.data(), b.data(), &status), HasSubstr("space"));
  const Offset offsets[] = {0, 4};
  broken = view;
  broken.env_row_offsets = offsets;
  EXPECT_NE(call(broken, lambda.data(), bar.data(), b.data(), &status), "");
  EXPECT_THAT(b, ElementsAre(77, 77, 77));
  const auto made = [](const std::function<void(DerivativeOptions&)>& change, Device device = Device::cpu()) {
    DerivativeOptions options;
    change(options);
    return error_message([&] { Derivative(device, options); });
  };
  EXPECT_THAT(made([](auto& o) { o.residual_limit = kNan; }), HasSubstr("residual_limit"));
  EXPECT_THAT(made([](auto& o) { o.tie_tolerance = -1; }), HasSubstr("tie_tolerance"));
  EXPECT_THAT(made([](auto& o) { o.max_unknowns = -1; }), HasSubstr("max_unknowns"));
  EXPECT_THAT(made([](auto& o) { o.threads = -1; }), HasSubstr("threads"));
  EXPECT_THAT(made([](auto&) {}, Device::emulated()), HasSubstr("capacity.env_rows"));
}

}  // namespace
