#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stiction/error.hpp"
#include "stiction/residual.hpp"

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

// a = 2. lambda = 1: w = -1, x - P(x - w/a) = 1 - 1.5, r = -1. lambda = -1: w = -5, -1 - P(1.5) = -2.5, r = -5.
// Separating contact b = +3: lambda = 0 gives 0; lambda = 0.5: w = 4, 0.5 - P(-1.5) = 0.5, r = 1.
TEST(Verify, AUnilateralRowMeasuresItsGapOrItsReaction) {
  const auto pressed = one_cone(ConeKind::unilateral, {2}, {-3});
  EXPECT_EQ(residual_of(pressed, Law::convex, {1.5}).absolute, 0.0);
  EXPECT_EQ(residual_of(pressed, Law::convex, {1.0}).absolute, 1.0);
  EXPECT_EQ(residual_of(pressed, Law::convex, {-1.0}).absolute, 5.0);
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
}

TEST(Verify, ABoxWithoutBoundsIsAFreeRow) {
  auto environment = one_cone(ConeKind::box, {1}, {-5});
  environment.lo = {-kInfinity};
  environment.hi = {kInfinity};
  EXPECT_EQ(residual_of(environment, Law::convex, {5}).absolute, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {4}).absolute, 1.0);
}

// A = I, b = (-2, 3, 0), mu = 1/2. Coulomb: lambda_n = 2 keeps w_n = 0, the contact slides along +t and is braked by
// mu lambda_n = 1. So lambda = (2, -1, 0), w = (0, 2, 0). For the convex law that is no solution: there w_n = mu
// norm(w_t), so with lambda = (n, -n/2, 0): n - 2 = (3 - n/2) / 2, n = 2.8.
TEST(Verify, SlidingSolvesOneLawAndNotTheOther) {
  auto environment = one_cone(ConeKind::friction, {1, 1, 1}, {-2, 3, 0});
  environment.mu = {0, 0.5, 0.5};
  EXPECT_NEAR(residual_of(environment, Law::coulomb, {2, -1, 0}).absolute, 0.0, 1e-15);
  EXPECT_GT(residual_of(environment, Law::convex, {2, -1, 0}).absolute, 0.1);
  EXPECT_NEAR(residual_of(environment, Law::convex, {2.8, -1.4, 0}).absolute, 0.0, 1e-15);
  EXPECT_GT(residual_of(environment, Law::coulomb, {2.8, -1.4, 0}).absolute, 0.1);
}

// lambda = 0 under A = I, b = (-2, 3, 4), mu = 1/2: x = 0, y = mu w = (-2, 1.5, 2), norm 2.5. Convex: z = (2, -1.5,
// -2), outside of the cone, P(z) = 2.25 (1, -0.6, -0.8), norm 2.25 sqrt 2. Coulomb: y_n = 0.5, z = (-0.5, -1.5, -2),
// P(z) = (1, -0.6, -0.8). Divided by max|b| = 4.
TEST(Verify, NoReactionAtAllIsMeasuredByTheProjection) {
  auto environment = one_cone(ConeKind::friction, {1, 1, 1}, {-2, 3, 4});
  environment.mu = {0, 0.5, 0.5};
  EXPECT_NEAR(residual_of(environment, Law::convex, {0, 0, 0}).relative, 2.25 * std::sqrt(2.0) / 4, 1e-15);
  EXPECT_NEAR(residual_of(environment, Law::coulomb, {0, 0, 0}).relative, std::sqrt(2.0) / 4, 1e-15);
}

// a = (1 + 1 + 4) / 3 = 2. The normal and the first axis are solved; 0.25 on the axis without friction counts 0.25 a.
TEST(Verify, AReactionOnAnAxisWithoutFrictionIsAPenalty) {
  auto environment = one_cone(ConeKind::friction, {1, 1, 4}, {-2, 0, 3});
  environment.mu = {0, 0.5, 0};
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, 0}).absolute, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {2, 0, -0.25}).absolute, 0.5);
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
  EXPECT_EQ(residuals[0].relative, 0.5);
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

TEST(Verify, AnEnvironmentAtRestDividesByATinyNumberNotByZero) {
  const auto environment = one_cone(ConeKind::free, {1}, {0});
  EXPECT_EQ(residual_of(environment, Law::convex, {0.0}).relative, 0.0);
  EXPECT_EQ(residual_of(environment, Law::convex, {1e-10}).relative, 1e-10 / 1e-300);
}

// a = 2^-1037, a subnormal number. lambda = 0 leaves w = -8: -w / a overflows, r = a x - P(a x - w) = -8 does not.
TEST(Verify, ADiagonalNearZeroIsNoReasonToOverflow) {
  EXPECT_EQ(residual_of(one_cone(ConeKind::unilateral, {0x1p-1037}, {-8}), Law::convex, {0.0}).absolute, 8.0);
  auto box = one_cone(ConeKind::box, {0x1p-1037}, {-8});
  box.lo = {-1};
  box.hi = {0x1p1000};  // a hi = 2^-37: as far as the bound lets r go
  EXPECT_EQ(residual_of(box, Law::convex, {0.0}).absolute, 0x1p-37);
  auto friction = one_cone(ConeKind::friction, {0x1p-1037, 0x1p-1037}, {-8, 0});
  friction.mu = {0, 0.5};
  EXPECT_EQ(residual_of(friction, Law::coulomb, {0, 0}).absolute, 8.0);
}

// No reaction, w = b = (-4, 3, 4) scale, mu = 1: z = -w, onto the cone at
// (4 + 5) / 2 (1, -3/5, -4/5): r = sqrt(2) 4.5.
TEST(Verify, NumbersWhoseSquaresAreOutOfRangeAreJudgedAsAnyOther) {
  for (const double scale : {1.0, 0x1p-700, 0x1p700}) {
    auto friction = one_cone(ConeKind::friction, {1, 1, 1}, {-4 * scale, 3 * scale, 4 * scale});
    friction.mu = {0, 1, 1};
    EXPECT_NEAR(residual_of(friction, Law::convex, {0, 0, 0}).absolute / scale, 4.5 * std::sqrt(2.0), 1e-14);
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

// Every kind of cone in one unsymmetric system of 13 rows; axis 3 of the second friction cone has no friction. The
// expected numbers are those of the independent checker (Python, numpy) that judges solutions of contact batches.
TEST(Verify, AgreesWithTheIndependentCheckerOnEveryKindOfCone) {
  constexpr Index kRows = 13;
  Environment<double> environment;
  environment.cones = {{ConeKind::free, 1, -1},     {ConeKind::unilateral, 1, -1}, {ConeKind::box, 1, -1},
                       {ConeKind::friction, 3, -1}, {ConeKind::friction, 6, -1},   {ConeKind::unilateral, 1, -1}};
  std::vector<double> matrix;
  for (Index i = 0; i < kRows; ++i) {
    for (Index j = 0; j < kRows; ++j) matrix.push_back(i == j ? 4.0 : 1.0 / (1 + i + 2 * j));
    environment.b.push_back((i % 2 == 0 ? 1.0 : -1.0) * (0.5 + 0.25 * i));
    environment.R.push_back(0.125 * (i % 3));
  }
  environment.set_dense(matrix, kRows);
  environment.mu = {0, 0, 0, 0, 0.5, 0.25, 0, 0.5, 1.5, 0, 0.125, 0.0625, 0};
  environment.lo.assign(kRows, 0.0);
  environment.hi.assign(kRows, 0.0);
  environment.lo[2] = -0.75;
  environment.hi[2] = 0.75;
  const std::vector<double> lambda{0.5, 0.25, -0.75, 1, 0.25, -0.125, 2, -0.5, 0.5, 0.25, 0.0625, -0.03125, 0};
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 2.2655338429961462, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::coulomb, lambda).relative, 2.8072797358485886, 1e-14);
}

// Environment 0 of the FCLIB-derived file coulomb/small.h5 of the shared data: one sliding contact. Expected: the
// checker's numbers for the stored reference, and for the reference times 1.25.
TEST(Verify, AgreesWithTheIndependentCheckerOnARecordedCoulombContact) {
  Environment<double> environment;
  environment.cones = {{ConeKind::friction, 3, -1}};
  environment.set_dense(std::vector<double>{0.01561729905012577, -1.0655799081608867e-14, 1.7158644344052322e-15,
                                            7.981228895182632e-15, 0.015617299050235248, 9.116734914056958e-15,
                                            -5.230882430029561e-15, 6.346284194006859e-15, 0.015617299050090447},
                        3);
  environment.b = {-0.00027270065311702494, 0.0001125771176745515, 6.823759394344223e-05};
  environment.mu = {0, 0.3, 0.3};
  std::vector<double> lambda{0.017461447862509104, -0.0044797382874196745, -0.002715352538288052};
  EXPECT_LT(residual_of(environment, Law::coulomb, lambda).relative, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 0.03876489586509408, 1e-14);
  for (double& value : lambda) value *= 1.25;
  EXPECT_NEAR(residual_of(environment, Law::coulomb, lambda).relative, 0.17677669529664433, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 0.1539217020083041, 1e-14);
}

// Environment 1 of mujoco/car.h5 of the shared data: a joint limit and two contacts, A unsymmetric in the last bits.
TEST(Verify, AgreesWithTheIndependentCheckerOnARecordedCar) {
  Environment<double> environment;
  environment.cones = {{ConeKind::unilateral, 1, -1}, {ConeKind::friction, 3, -1}, {ConeKind::friction, 3, -1}};
  environment.set_dense(
      std::vector<double>{11.516565514066901,  -1.4335996222020284,   -0.012235375821121157, -0.05038171276194473,
                          -1.4311403588040361, -0.012511863830869791, -0.040332110713026906, -1.4335996222020277,
                          9.485152981971387,   3.0180684719584776,    -0.1927772337736745,   7.608777908615247,
                          3.0074323092484625,  -0.11191013699189983,  -0.012235375821121167, 3.0180684719584767,
                          4.070970851372634,   -2.4808867483793917,   2.1530688337883457,    4.054464663292302,
                          -2.0378789687362837, -0.05038171276194487,  -0.1927772337736743,   -2.4808867483793917,
                          38.591630833536456,  -0.13256830395189007,  -2.4633566606921513,   37.9879843873724,
                          -1.4311403588040366, 7.608777908615245,     2.153068833788346,     -0.13256830395189012,
                          6.270683916773335,   2.1455120394213316,    -0.07588383957613873,  -0.0125118638308698,
                          3.007432309248461,   4.054464663292303,     -2.4633566606921518,   2.145512039421332,
                          4.0381434043593085,  -2.026337759623532,    -0.040332110713027156, -0.11191013699189971,
                          -2.0378789687362837, 37.98798438737241,     -0.07588383957613877,  -2.026337759623532,
                          37.59000378721918},
      7);
  environment.b = {0.04624634877153255, -23.20107120900994,  -4.170574243933389, 140.1496999993192,
                   -21.914932125777597, -4.2179565939993635, 141.93148757911877};
  environment.R = {0.16560347350599158, 0.25503731491513776, 0.25503731491513776, 0.25503731491513776,
                   0.2952095590529801,  0.2952095590529801,  0.2952095590529801};
  environment.mu = {0, 0, 1, 1, 0, 1, 1};
  std::vector<double> lambda{0.560488261646353, 0, 0, 0, 4.739809307314852, -2.7947336000305216, -3.828218433497354};
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 4.016806220671451e-11, 1e-14);
  EXPECT_NEAR(residual_of(environment, Law::coulomb, lambda).relative, 0.013443401508535588, 1e-14);
  for (double& value : lambda) value *= 1.25;
  EXPECT_NEAR(residual_of(environment, Law::convex, lambda).relative, 0.2400429153609713, 1e-13);
}

}  // namespace
