#include "core/algorithm/problem/cone_projection.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "scenes/rng.hpp"

namespace {

using namespace stiction;

template <int M>
std::array<double, M> onto_cone(const std::array<double, M>& z) {
  double x[M];
  for (std::size_t k = 0; k < M; ++k) x[k] = z[k];
  project_second_order_cone<M>(x);
  std::array<double, M> result;
  for (std::size_t k = 0; k < M; ++k) result[k] = x[k];
  return result;
}

template <std::size_t M>
double dot(const std::array<double, M>& a, const std::array<double, M>& b) {
  double sum = 0;
  for (std::size_t k = 0; k < M; ++k) sum += a[k] * b[k];
  return sum;
}

template <std::size_t M>
double tangential(const std::array<double, M>& a) {
  double sum = 0;
  for (std::size_t k = 1; k < M; ++k) sum += a[k] * a[k];
  return std::sqrt(sum);
}

TEST(Cones, TheHalfLineCutsWhatIsNegative) {
  EXPECT_EQ(project_half_line(2.5), 2.5);
  EXPECT_EQ(project_half_line(-2.5), 0.0);
  EXPECT_EQ(project_half_line(0.0), 0.0);
  EXPECT_FALSE(std::signbit(project_half_line(-0.0)));
}

TEST(Cones, TheDiskLeavesTheInsideAloneAndShortensTheRest) {
  double inside[] = {9, 0.3, 0.4};
  project_disk<3>(inside, 0.5 + 1e-9);
  EXPECT_EQ(inside[1], 0.3);
  EXPECT_EQ(inside[2], 0.4);
  double outside[] = {9, 3, 4};
  project_disk<3>(outside, 1.0);
  EXPECT_NEAR(outside[1], 0.6, 1e-15);
  EXPECT_NEAR(outside[2], 0.8, 1e-15);
  EXPECT_EQ(outside[0], 9) << "the normal is not the disk's business";
}

TEST(Cones, ADiskWithoutRadiusHoldsNothingAndMakesNoNaN) {
  double still[] = {0, 0, 0};
  project_disk<3>(still, 0.0);
  EXPECT_EQ(still[1], 0.0);
  double moving[] = {0, 3, -4};
  project_disk<3>(moving, 0.0);
  EXPECT_EQ(moving[1], 0.0);
  EXPECT_EQ(moving[2], 0.0);
}

TEST(Cones, ThePointsOfTheSecondOrderConeStay) {
  EXPECT_EQ(onto_cone<3>({5.0 + 1e-9, 3, 4}), (std::array<double, 3>{5.0 + 1e-9, 3, 4}));
  EXPECT_EQ(onto_cone<3>({1, 0, 0}), (std::array<double, 3>{1, 0, 0}));
  EXPECT_EQ(onto_cone<3>({0, 0, 0}), (std::array<double, 3>{0, 0, 0}));
}

TEST(Cones, ThePolarConeGoesToTheApexAlsoWithoutATangentialPart) {
  // Membership of the cone alone would leave (-1, 0, 0) where it is: its tangential part is on the "disk" of radius 0.
  EXPECT_EQ(onto_cone<3>({-1, 0, 0}), (std::array<double, 3>{0, 0, 0}));
  EXPECT_EQ(onto_cone<3>({-5, 3, 4}), (std::array<double, 3>{0, 0, 0}));
  EXPECT_EQ(onto_cone<2>({-2, 1}), (std::array<double, 2>{0, 0}));
}

TEST(Cones, BetweenThemTheBoundaryIsHit) {
  // n = 0, norm 5: half the sum is 2.5.
  const auto p = onto_cone<3>({0, 3, 4});
  EXPECT_EQ(p[0], 2.5);
  EXPECT_NEAR(p[1], 1.5, 1e-15);
  EXPECT_NEAR(p[2], 2.0, 1e-15);
}

template <int M>
void expect_moreau(std::uint64_t seed) {
  scenes::Rng rng(seed);
  for (int sample = 0; sample < 20000; ++sample) {
    std::array<double, M> z, mirrored, other;
    for (std::size_t k = 0; k < M; ++k) {
      z[k] = rng.symmetric(2.0);
      mirrored[k] = -z[k];
      other[k] = rng.symmetric(2.0);
    }
    const auto p = onto_cone<M>(z);
    // The cone is its own dual, so the polar part is minus the projection of -z: z = p - q, p orthogonal to q.
    const auto q = onto_cone<M>(mirrored);
    for (std::size_t k = 0; k < M; ++k) ASSERT_NEAR(p[k] - q[k], z[k], 4e-15);
    ASSERT_NEAR(dot(p, q), 0.0, 2e-14);
    ASSERT_GE(p[0] * (1 + 1e-15) + 1e-15, tangential(p));
    // No point of the cone is closer: (z - p)'(c - p) <= 0.
    const auto c = onto_cone<M>(other);
    double obtuse = 0;
    for (std::size_t k = 0; k < M; ++k) obtuse += (z[k] - p[k]) * (c[k] - p[k]);
    ASSERT_LE(obtuse, 2e-14);
  }
}

TEST(Cones, EveryPointSplitsIntoAConePartAndAPolarPart) {
  expect_moreau<2>(1);
  expect_moreau<3>(2);
  expect_moreau<4>(3);
  expect_moreau<5>(4);
  expect_moreau<6>(5);
}

TEST(Cones, InAnotherMetricTheNearestPointIsFound) {
  scenes::Rng rng(11);
  for (int sample = 0; sample < 20000; ++sample) {
    const double share = sample % 5 == 0 ? 0.5 : std::pow(2.0, -20 * rng.uniform());
    double p[3], z[3];
    for (int k = 0; k < 3; ++k) p[k] = z[k] = rng.symmetric(2.0);
    project_second_order_cone<3>(p, share);
    ASSERT_GE(p[0] * (1 + 1e-15) + 1e-15, std::hypot(p[1], p[2]));
    // The metric's image of p - z is in the cone's dual, which is the cone, and does not push p. These are the
    // conditions of the nearest point.
    const double g[] = {(1 - share) * (p[0] - z[0]), share * (p[1] - z[1]), share * (p[2] - z[2])};
    ASSERT_GE(g[0] + 4e-15, std::hypot(g[1], g[2])) << "share " << share;
    ASSERT_NEAR(g[0] * p[0] + g[1] * p[1] + g[2] * p[2], 0.0, 1e-14) << "share " << share;
  }
}

TEST(Cones, AMetricWithoutTangentialRowsAsksForTheNormalAlone) {
  double slides[] = {2, 30, 40};
  project_second_order_cone<3>(slides, 0.0);
  EXPECT_EQ(slides[0], 2.0);
  EXPECT_NEAR(std::hypot(slides[1], slides[2]), 2.0, 1e-15);
  double leaves[] = {-2, 30, 40};
  project_second_order_cone<3>(leaves, 0.0);
  for (const double entry : leaves) EXPECT_EQ(entry, 0.0);
}

TEST(Cones, WhatIsPolarStaysSoWhereItsLengthOverflows) {
  // An open contact whose tangential motion is beyond all bounds, with de Saxce's term: the sum of both is NaN.
  for (const double share : {0.5, 0.25}) {
    double z[] = {-std::numeric_limits<double>::infinity(), 1e203, -1e203};
    project_second_order_cone<3>(z, share);
    for (const double entry : z) EXPECT_EQ(entry, 0.0);
  }
}

TEST(Cones, ProjectingAgainMovesByRoundingOnly) {
  scenes::Rng rng(7);
  for (int sample = 0; sample < 20000; ++sample) {
    std::array<double, 4> z;
    for (double& entry : z) entry = rng.symmetric(2.0);
    const auto once = onto_cone<4>(z);
    const auto twice = onto_cone<4>(once);
    for (std::size_t k = 0; k < 4; ++k) ASSERT_NEAR(twice[k], once[k], 2e-15);
  }
}

}  // namespace
