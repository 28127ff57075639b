#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/residual.hpp"
#include "stiction/status.hpp"

namespace {

using namespace stiction;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class Real>
Residual residual_of(const Environment<Real>& environment, Law law, const std::vector<Real>& lambda) {
  ContactBatch<Real> batch(law);
  batch.add(environment);
  return verify(batch.view(), std::span<const Real>(lambda)).at(0);
}

/// One cone on a diagonal matrix.
Environment<double> one_cone(ConeKind kind, std::vector<double> diagonal, std::vector<double> b) {
  const auto n = static_cast<Index>(diagonal.size());
  std::vector<double> matrix(diagonal.size() * diagonal.size(), 0.0);
  for (std::size_t i = 0; i < diagonal.size(); ++i) matrix[i * (diagonal.size() + 1)] = diagonal[i];
  Environment<double> environment;
  environment.cones = {{kind, n, -1}};
  environment.set_dense(matrix, n);
  environment.b = std::move(b);
  return environment;
}

TEST(Verify, AFreeRowsResidualIsItsMotion) {
  const auto environment = one_cone(ConeKind::free, {2}, {-3});
  EXPECT_EQ(residual_of(environment, Law::convex, {1.5}).absolute, 0.0);
  const Residual residual = residual_of(environment, Law::convex, {1.0});  // w = 2 - 3 = -1
  EXPECT_EQ(residual.absolute, 1.0);
  EXPECT_EQ(residual.relative, 1.0 / 3.0);
}

// d = 2. lambda = 1: x = 2, w = -1, nearest is pressed (2, 0): 1. lambda = -1: x = -2, w = -5, nearest is open: both
// are off. A contact that opens, b = +3: lambda = 0 gives 0; lambda = 0.5: x = 1, w = 4, nearest is open: 1.
TEST(Verify, AUnilateralRowMeasuresItsGapOrItsReaction) {
  const auto pressed = one_cone(ConeKind::unilateral, {2}, {-3});
  EXPECT_EQ(residual_of(pressed, Law::convex, {1.5}).absolute, 0.0);
  EXPECT_EQ(residual_of(pressed, Law::convex, {1.0}).absolute, 1.0);
  EXPECT_NEAR(residual_of(pressed, Law::convex, {-1.0}).absolute, std::sqrt(29.0), 1e-15);
  EXPECT_EQ(residual_of(pressed, Law::convex, {0.0}).relative, 1.0);
  const auto leaving = one_cone(ConeKind::unilateral, {2}, {3});
  EXPECT_EQ(residual_of(leaving, Law::convex, {0.0}).absolute, 0.0);
  EXPECT_EQ(residual_of(leaving, Law::convex, {0.5}).absolute, 1.0);
}

// a = 1. Bounds -0.5 and 2. At hi with w = 2 - 5 = -3 <= 0, inside with w = 0, at lo with w = 3.5 >= 0. Beyond hi by 1
// with w = -2 the nearest allowed point is hi: r = 1.
TEST(Verify, ABoxRowUsesBothOfItsBounds) {
  const auto box = [](double b) {
    auto environment = one_cone(ConeKind::box, {1}, {b});
    environment.lo = {-0.5};
    environment.hi = {2};
    return environment;
  };
  EXPECT_EQ(residual_of(box(-5), Law::convex, {2}).absolute, 0.0);
  EXPECT_EQ(residual_of(box(-1), Law::convex, {1}).absolute, 0.0);
  EXPECT_EQ(residual_of(box(4), Law::convex, {-0.5}).absolute, 0.0);
  EXPECT_EQ(residual_of(box(-5), Law::convex, {3}).absolute, 1.0);
  EXPECT_EQ(residual_of(box(4), Law::convex, {2}).absolute, 2.5) << "held at the wrong bound";
  EXPECT_EQ(residual_of(box(-5), Law::convex, {-0.5}).absolute, 2.5) << "held at the wrong bound";
  EXPECT_EQ(residual_of(box(-1.25), Law::convex, {1}).absolute, 0.25) << "inside, and moves";
}

TEST(Verify, ABoxWithoutBoundsIsAFreeRow) {
  auto environment = one_cone(ConeKind::box, {1}, {-5});
  environment.lo = {-kInfinity};
  environment.hi = {kInfinity};
  EXPECT_EQ(residual_of(environment, Law::convex, {5}).absolute, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {4}).absolute, 1.0);
}

// A = I, b = (-2, 3, 0), mu = 1/2. Coulomb: lambda_n = 2 keeps w_n = 0, the contact slides along +t and is braked by
// mu lambda_n = 1. Hence lambda = (2, -1, 0), w = (0, 2, 0). For the convex law that is no solution: there w_n = mu
// norm(w_t), so with lambda = (n, -n/2, 0): n - 2 = (3 - n/2) / 2, n = 2.8.
TEST(Verify, SlidingSolvesOneLawAndNotTheOther) {
  auto environment = one_cone(ConeKind::friction, {1, 1, 1}, {-2, 3, 0});
  environment.mu = {0, 0.5, 0.5};
  EXPECT_NEAR(residual_of(environment, Law::coulomb, {2, -1, 0}).absolute, 0.0, 1e-15);
  EXPECT_GT(residual_of(environment, Law::convex, {2, -1, 0}).absolute, 0.1);
  EXPECT_NEAR(residual_of(environment, Law::convex, {2.8, -1.4, 0}).absolute, 0.0, 1e-15);
  EXPECT_GT(residual_of(environment, Law::coulomb, {2.8, -1.4, 0}).absolute, 0.1);
}

// lambda = 0 under A = I, b = (-2, 3, 4), mu = 1/2. The nearest member is an open contact. Under Coulomb's law w_n
// has to be 0. Under the convex one w has to reach the cone w_n = |mu w_t|, which is 4.5 * 2 / sqrt(5) away. Such is
// the scale, too.
TEST(Verify, NoReactionAtAllIsOffByTheMotionInward) {
  auto environment = one_cone(ConeKind::friction, {1, 1, 1}, {-2, 3, 4});
  environment.mu = {0, 0.5, 0.5};
  EXPECT_EQ(residual_of(environment, Law::coulomb, {0, 0, 0}).absolute, 2.0);
  EXPECT_NEAR(residual_of(environment, Law::convex, {0, 0, 0}).absolute, 9 / std::sqrt(5.0), 1e-15);
  for (const Law law : {Law::convex, Law::coulomb}) EXPECT_EQ(residual_of(environment, law, {0, 0, 0}).relative, 1.0);
}

// A = I, mu = 1/2, (x, y) given by lambda and b = w - lambda. Each is 0.01 from one member of the law and far from all
// others. A judge that forgets a member finds more.
TEST(Verify, EveryMemberOfAContactsLawIsThere) {
  const auto error = [](Law law, const std::vector<double>& lambda, const std::vector<double>& w) {
    std::vector<double> b;
    for (std::size_t k = 0; k < w.size(); ++k) b.push_back(w[k] - lambda[k]);
    auto environment = one_cone(ConeKind::friction, {1, 1, 1}, b);
    environment.mu = {0, 0.5, 0.5};
    return residual_of(environment, law, lambda).absolute;
  };
  for (const Law law : {Law::convex, Law::coulomb}) {
    const double g = law == Law::convex ? 1 : 0;
    EXPECT_NEAR(error(law, {0.01, 0, 0}, {5, 3, 4}), 0.01, 1e-14) << "open";
    EXPECT_NEAR(error(law, {0, 0, 0}, {g * 2.5 - 0.01, 3, 4}), g > 0 ? 0.02 / std::sqrt(5.0) : 0.01, 1e-14)
        << "open, and moves inward";
    EXPECT_NEAR(error(law, {5, 0.3, 0.4}, {0, 0, 0.01}), 0.01, 1e-14) << "sticks";
    // Slides along (0.6, 0.8): x = 5 (1, -0.3, -0.4), y = c (g, 1.2, 1.6) + 0.01 sideways, then x sideways.
    EXPECT_NEAR(error(law, {5, -1.5, -2}, {0.1 * g, 0.12 + 0.008, 0.16 - 0.006}), 0.01, 1e-14)
        << "slides against lambda";
    EXPECT_NEAR(error(law, {5, -1.5 + 0.008, -2 - 0.006}, {10 * g, 12, 16}), 0.01, 1e-4) << "slides along w";
  }
  EXPECT_GT(error(Law::coulomb, {5, -1.5, -2}, {10, 12, 16}), 4.9) << "slides by the other law";
}

// Rows of the diagonal 1 and 4: u = 1/2, m = mu / u = 1. x = (2, u 4 lambda_t), y = (w_n, u w_t). A reaction on the
// edge of the cone and one 0.25 beyond it: a judge with 1/u for u differs.
TEST(Verify, RowsAreBroughtToTheUnitOfTheNormalOne) {
  auto environment = one_cone(ConeKind::friction, {1, 4}, {-2, 4});
  environment.mu = {0, 0.5};
  EXPECT_EQ(residual_of(environment, Law::convex, {2, -1}).absolute, 0.0) << "sticks on the edge";
  environment.b = {-2, 5};
  EXPECT_EQ(residual_of(environment, Law::convex, {2, -1.25}).absolute, 0.5 * std::sqrt(0.5))
      << "0.5 beyond the edge of a cone of slope 1 and without motion; sliding by reaction is the nearest";
}

// d = (1, 1, 4), u = 1/2 of the axis without friction: its reaction 0.25 moves it by 0.25 * 4 / 2.
TEST(Verify, AReactionOnAnAxisWithoutFrictionIsAnError) {
  auto environment = one_cone(ConeKind::friction, {1, 1, 4}, {-2, 0, 3});
  environment.mu = {0, 0.5, 0};
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, 0}).absolute, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, -0.25}).absolute, 0.5);
  environment.mu = {0, 0, 0};
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, 0}).absolute, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, -0.25}).absolute, 0.5);
}

// Boxed friction: axis by axis between -mu lambda_n and mu lambda_n = 1, whatever the other axis does.
TEST(Verify, BoxedFrictionIsABoxBesideTheNormalRow) {
  auto environment = one_cone(ConeKind::box_friction, {1, 1, 1}, {-2, 3, -4});
  environment.mu = {0, 0.5, 0.5};
  EXPECT_EQ(residual_of(environment, Law::convex, {2, -1, 1}).absolute, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, 1}).absolute, 1.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {2, -1.25, 1}).absolute, 0.25);
}

// Off-diagonals times sqrt(2); z = x - w is split into its positive and negative part, each 1 off: sqrt(2).
TEST(Verify, ASemidefiniteConeIsSplitByItsEigenvalues) {
  const auto environment = one_cone(ConeKind::semidefinite, {1, 1, 1}, {-2, 0, 3});
  EXPECT_NEAR(residual_of(environment, Law::convex, {2, 0, 0}).absolute, 0.0, 1e-15);
  EXPECT_NEAR(residual_of(environment, Law::convex, {1, 0, 0}).absolute, std::sqrt(2.0), 1e-15);
}

// mu = 1000: the contact opens at 1 m/s and keeps a friction of 1. Divided by mu it would be an error of 0.001.
TEST(Verify, ALargeMuHidesNoFriction) {
  for (const double mu : {1e3, 1e6, 1e12}) {
    auto environment = one_cone(ConeKind::friction, {1, 1, 1}, {1, 2, 0});
    environment.mu = {0, mu, mu};
    EXPECT_GT(residual_of(environment, Law::coulomb, {1 / mu, -1, 0}).absolute, 0.99) << mu;
    EXPECT_EQ(residual_of(environment, Law::coulomb, {0, 0, 0}).absolute, 0.0) << mu;
  }
}

// A rolling axis: w_t = 0.01 asks for a reaction of -mu lambda_n, whatever mu is. Times mu it would be no error at all.
TEST(Verify, ASmallMuHidesNoReaction) {
  for (const double mu : {1e-3, 1e-4, 1e-8}) {
    auto environment = one_cone(ConeKind::friction, {1, 1}, {-9.81, 0.01});
    environment.mu = {0, mu};
    const double right = mu * 9.81 < 0.01 ? mu * 9.81 : 0.01;
    EXPECT_LT(residual_of(environment, Law::coulomb, {9.81, -right}).absolute, 1e-15) << mu;
    EXPECT_NEAR(residual_of(environment, Law::coulomb, {9.81, 0}).absolute, right / std::sqrt(1 + mu * mu), 1e-15)
        << mu << ", the distance from the line (1, -mu)";
  }
}

/// A pressed cone of each kind, without a reaction: it is all wrong.
std::vector<Environment<double>> pressed_cones() {
  std::vector<Environment<double>> found;
  found.push_back(one_cone(ConeKind::free, {2}, {-0.05}));
  found.push_back(one_cone(ConeKind::unilateral, {2}, {-0.05}));
  found.push_back(one_cone(ConeKind::box, {2}, {-0.05}));
  found.back().lo = {-1};
  found.back().hi = {1};
  for (const auto kind : {ConeKind::friction, ConeKind::box_friction})
    for (std::size_t rows = 2; rows <= 6; ++rows) {
      std::vector<double> b(rows, 0.01);
      b[0] = -0.05;
      found.push_back(one_cone(kind, std::vector<double>(rows, 2.0), b));
      found.back().mu.assign(rows, 0.5);
    }
  found.push_back(one_cone(ConeKind::semidefinite, {2, 2, 2}, {-0.05, 0, -0.05}));
  found.push_back(one_cone(ConeKind::semidefinite, {2, 2, 2, 2, 2, 2}, {-0.05, 0, -0.05, 0, 0, -0.05}));
  return found;
}

/// `cone` beside a contact that opens at `speed`, coupled to it by `entry`.
Environment<double> beside(const Environment<double>& cone, double speed, double entry) {
  const std::size_t n = cone.b.size() + 1;
  std::vector<double> matrix(n * n, 0.0);
  for (std::size_t k = 0; k < n; ++k) matrix[k * (n + 1)] = 2;
  matrix[n - 1] = entry;
  Environment<double> found = cone;
  found.cones.push_back({ConeKind::unilateral, 1, -1});
  found.row_offsets = {0};
  found.column.clear();
  found.A.clear();
  found.set_dense(matrix, static_cast<Index>(n));
  found.b.push_back(speed);
  for (auto* values : {&found.mu, &found.lo, &found.hi})
    if (!values->empty()) values->push_back(0);
  return found;
}

TEST(Verify, AnotherIslandChangesNoRelativeError) {
  for (const auto& cone : pressed_cones())
    for (const Law law : {Law::convex, Law::coulomb}) {
      SCOPED_TRACE(to_string(cone.cones[0].kind) + std::string(" ") + std::to_string(cone.b.size()));
      const std::vector<double> none(cone.b.size() + 1, 0.0);
      const Residual alone = residual_of(cone, law, std::vector<double>(cone.b.size(), 0.0));
      EXPECT_EQ(alone.relative, 1.0);
      const Residual apart = residual_of(beside(cone, 1e6, 0), law, none);
      EXPECT_EQ(apart.relative, 1.0);
      EXPECT_EQ(apart.scale, alone.scale);
      EXPECT_EQ(apart.cone, 0);
      // A contact that opens has no error, so it adds to its own island no more than a share of its b.
      EXPECT_EQ(residual_of(beside(cone, 40, 0.125), law, none).relative, 1.0);
      EXPECT_EQ(residual_of(beside(cone, 1e6, 0.125), law, none).scale, 1e-4 * 1e6);
    }
}

TEST(Verify, AnIslandThatNeedsNothingHasAScaleStill) {
  const auto leaving = one_cone(ConeKind::unilateral, {1}, {3});
  const Residual residual = residual_of(leaving, Law::convex, {1e-4});
  EXPECT_DOUBLE_EQ(residual.scale, 3e-4);
  EXPECT_NEAR(residual.relative, 1.0 / 3, 1e-15);
}

// d = 0: a reaction moves nothing and weighs nothing. The contact beside it is judged as ever.
TEST(Verify, ARowThatCannotMoveSpoilsNoOther) {
  Environment<double> environment = one_cone(ConeKind::unilateral, {0, 1}, {1, -2});
  environment.cones = {{ConeKind::unilateral, 1, -1}, {ConeKind::unilateral, 1, -1}};
  EXPECT_EQ(residual_of(environment, Law::convex, {0, 2}).relative, 0.0);
  environment.b[0] = -1;
  const Residual residual = residual_of(environment, Law::convex, {0, 2});
  EXPECT_EQ(residual.absolute, 1.0);
  EXPECT_EQ(residual.relative, 1.0);
  EXPECT_EQ(residual.cone, 0);
  auto friction = one_cone(ConeKind::friction, {1, 0}, {-2, 0});
  friction.mu = {0, 1};
  EXPECT_EQ(residual_of(friction, Law::convex, {2, 0}).absolute, 0.0);
}

// b = 0 and lo = 1: lambda = 1 at w = 1 is right, lambda = 0 is 1 off, and that is the scale.
TEST(Verify, BoundsThatExcludeZeroHaveAScaleWithoutB) {
  auto box = one_cone(ConeKind::box, {1}, {0});
  box.lo = {1};
  box.hi = {kInfinity};
  EXPECT_EQ(residual_of(box, Law::convex, {1}).relative, 0.0);
  EXPECT_EQ(residual_of(box, Law::convex, {0}).relative, 1.0);
  EXPECT_EQ(residual_of(box, Law::convex, {0}).scale, 1.0);
  box.hi = {1};
  EXPECT_EQ(residual_of(box, Law::convex, {1}).relative, 0.0) << "lo = hi";
}

TEST(Verify, ABoundOf1e20IsNone) {
  for (const double none : {1e20, 1e300}) {
    auto box = one_cone(ConeKind::box, {1}, {-1.5 * none});
    box.lo = {-none};
    box.hi = {none};
    EXPECT_EQ(residual_of(box, Law::convex, {none}).absolute, 0.5 * none);
    box.b = {1.5 * none};
    EXPECT_EQ(residual_of(box, Law::convex, {-none}).absolute, 0.5 * none);
  }
  auto box = one_cone(ConeKind::box, {1}, {-5e20});
  box.lo = {-1e19};
  box.hi = {1e19};
  EXPECT_EQ(residual_of(box, Law::convex, {1e19}).absolute, 0.0) << "a bound below it is one";
}

TEST(Verify, TheWorstConeOfAnEnvironmentCountsAndEnvironmentsAreSeparate) {
  ContactBatch<double> batch;
  Environment<double> two;
  two.cones = {{ConeKind::free, 1, -1}, {ConeKind::free, 1, -1}};
  two.set_dense(std::vector<double>{1, 0, 0, 1}, 2);
  two.b = {-1, -4};
  batch.add(two);
  batch.add(Environment<double>{});
  batch.add(one_cone(ConeKind::free, {1}, {-8}));
  const std::vector<double> lambda{0, 2, 8};
  const auto residuals = verify(batch.view(), std::span<const double>(lambda));
  ASSERT_EQ(residuals.size(), 3U);
  EXPECT_EQ(residuals[0].absolute, 2.0);
  EXPECT_EQ(residuals[0].relative, 1.0) << "two islands: of its own scale the small one is all wrong";
  EXPECT_EQ(residuals[0].cone, 0);
  EXPECT_EQ(residuals[0].scale, 1.0);
  EXPECT_EQ(worst_error(residuals[0]), 1.0);
  EXPECT_EQ(residuals[2].cone, -1) << "none has an error";
  EXPECT_EQ(residuals[1].relative, 0.0) << "an empty environment";
  EXPECT_EQ(residuals[2].relative, 0.0);
}

TEST(Verify, DuplicateEntriesAddUpAndComplianceIsOnTheDiagonal) {
  Environment<double> environment;
  environment.cones = {{ConeKind::free, 1, -1}};
  environment.row_offsets = {0, 2};
  environment.column = {0, 0};
  environment.A = {1.5, 0.25};
  environment.R = {0.25};
  environment.b = {-2};
  EXPECT_EQ(residual_of(environment, Law::convex, {1.0}).absolute, 0.0);
}

TEST(Verify, WhatIsNotFiniteIsInfinitelyWrong) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto leaving = one_cone(ConeKind::unilateral, {2}, {3});
  for (const double lambda : {nan, kInfinity, -kInfinity}) {
    EXPECT_EQ(residual_of(leaving, Law::convex, {lambda}).relative, kInfinity);
    EXPECT_EQ(residual_of(leaving, Law::convex, {lambda}).absolute, kInfinity);
  }
  EXPECT_EQ(residual_of(one_cone(ConeKind::unilateral, {2}, {nan}), Law::convex, {0}).relative, kInfinity);
  EXPECT_EQ(residual_of(one_cone(ConeKind::unilateral, {2}, {kInfinity}), Law::convex, {0}).relative, kInfinity);
  auto friction = one_cone(ConeKind::friction, {1, 1}, {-2, 1});
  friction.mu = {0, nan};
  EXPECT_EQ(residual_of(friction, Law::convex, {2, 0}).relative, kInfinity);
}

TEST(Verify, AnEnvironmentAtRestAcceptsNothingButItsAnswer) {
  const auto environment = one_cone(ConeKind::free, {1}, {0});
  EXPECT_EQ(residual_of(environment, Law::convex, {0.0}).relative, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {1e-10}).relative, kInfinity);
  EXPECT_EQ(residual_of(environment, Law::convex, {1e-10}).absolute, 1e-10);
}

TEST(Verify, ADiagonalNearZeroIsNoReasonToOverflow) {
  EXPECT_EQ(residual_of(one_cone(ConeKind::unilateral, {0x1p-1037}, {-8}), Law::convex, {0.0}).absolute, 8.0);
  auto box = one_cone(ConeKind::box, {0x1p-1037}, {-8});
  box.lo = {-1};
  box.hi = {0x1p60};
  EXPECT_EQ(residual_of(box, Law::convex, {0.0}).absolute, 0x1p-977) << "as far as the bound is";
  auto friction = one_cone(ConeKind::friction, {0x1p-1037, 0x1p-1037}, {-8, 0});
  friction.mu = {0, 0.5};
  EXPECT_EQ(residual_of(friction, Law::coulomb, {0, 0}).absolute, 8.0);
}

// No reaction, w = b = (-4, 3, 4) scale, mu = 1: open, 4 + 5 below the cone w_n = |w_t|.
TEST(Verify, NumbersWhoseSquaresAreOutOfRangeAreJudgedAsAnyOther) {
  for (const double scale : {1.0, 0x1p-1000, 0x1p1000}) {
    auto friction = one_cone(ConeKind::friction, {1, 1, 1}, {-4 * scale, 3 * scale, 4 * scale});
    friction.mu = {0, 1, 1};
    EXPECT_NEAR(residual_of(friction, Law::convex, {0, 0, 0}).absolute / scale, 9 / std::sqrt(2.0), 1e-14);
    EXPECT_EQ(residual_of(friction, Law::convex, {0, 0, 0}).relative, 1.0);
  }
}

TEST(Verify, SinglePrecisionIsJudgedInDouble) {
  Environment<float> environment;
  environment.cones = {{ConeKind::free, 1, -1}};
  environment.set_dense(std::vector<float>{1.0F}, 1);
  environment.b = {-1.0F};
  // 1 + 2^-23 is one ulp off; its residual is exactly that ulp.
  EXPECT_EQ(residual_of<float>(environment, Law::convex, {1.0F + std::numeric_limits<float>::epsilon()}).absolute,
            static_cast<double>(std::numeric_limits<float>::epsilon()));
}

TEST(Verify, RefusesALambdaOfTheWrongLengthAndABrokenStructure) {
  ContactBatch<double> batch;
  batch.add(one_cone(ConeKind::free, {1}, {-1}));
  const std::vector<double> two{1, 2}, one{1};
  const auto message = [](const ContactBatchView<double>& view, const std::vector<double>& lambda) -> std::string {
    try {
      verify(view, std::span<const double>(lambda));
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(message(batch.view(), two),
            "lambda has 2 entries, expected 1 (one per row of the batch); pass the solution of this batch");
  auto arrays = batch.arrays();
  arrays.column[0] = 1000000;
  const auto broken = ContactBatch<double>::from_arrays(Law::convex, arrays);
  EXPECT_EQ(message(broken.view(), one).find("batch cannot be verified: column[env 0, row 0] = 1000000"), 0U);
}

}  // namespace
