// Points of boxes with spheres, capsules and boxes, as robots have them, against hand answers and signed distances. A
// search over directions finds these without looking at faces, edges or corners.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/algorithm/articulated/boxes/touch_lanes.hpp"
#include "tests/support/systems/placed_shapes.hpp"

namespace stiction::test {

namespace {

constexpr double kFar = 10;  // a reach that keeps every point
constexpr double kFew = 1e-12;

ContactCandidate<double> deepest_of(const BoxPoints<double>& found) {
  return *std::max_element(found.at, found.at + found.count,
                           [](const auto& one, const auto& other) { return one.depth < other.depth; });
}

/// A random shape that overlaps a random box a little, or is a little apart.
struct Encounter {
  Shape one, box;
};
Encounter random_encounter(ShapeKind kind, std::mt19937_64& random) {
  std::uniform_real_distribution<double> size(0.1, 0.5), gap(-0.16, 0.04);
  const auto shape = [&](ShapeKind which) {
    const double x = size(random), y = size(random), z = size(random);
    return shape_of(which, {x, y, z}, {0, 0, 0}, random_turn(random));
  };
  Encounter pair{shape(kind), shape(ShapeKind::box)};
  const Point n = random_direction(random);
  pair.box.centre = scaled(support(pair.one, n) + support(pair.box, scaled(-1.0, n)) + gap(random), n);
  return pair;
}

class EveryKind : public testing::TestWithParam<ShapeKind> {};

TEST_P(EveryKind, DeepestPointSaysTheSignedDistance) {
  std::mt19937_64 random(20261);
  int compared = 0;
  for (int k = 0; k < 60; ++k) {
    const auto [one, box] = random_encounter(GetParam(), random);
    const double exact = signed_distance(one, box);
    const BoxPoints<double> found = points_with_box(one, box, kFar);
    ASSERT_GE(found.count, 1) << "case " << k;
    ASSERT_LE(found.count, kBoxPoints) << "case " << k;
    const ContactCandidate<double> deepest = deepest_of(found);
    const double gap = gap_along(one, box, deepest.normal);
    if (GetParam() == ShapeKind::box) {
      // A face is taken for an edge that is better by a twentieth, and its points may lie beside the deepest corner.
      EXPECT_LE(gap, -deepest.depth + 1e-9) << "case " << k;
      if (exact >= 0) continue;
      EXPECT_GE(gap, 1.06 * exact) << "case " << k;
      ++compared;
    } else if (exact > -one.size[0]) {  // the middle line is outside
      EXPECT_NEAR(gap, -deepest.depth, 1e-9) << "case " << k;
      EXPECT_LE(exact, 1e-9 - deepest.depth) << "case " << k;
      EXPECT_NEAR(exact, -deepest.depth, 1e-3) << "case " << k;
      ++compared;
    }
  }
  EXPECT_GE(compared, 15);
}

TEST_P(EveryKind, PointsLieHalfwayBetweenTheSurfacesAlongAUnitNormal) {
  std::mt19937_64 random(4711);
  int compared = 0;
  for (int k = 0; k < 200; ++k) {
    const auto [one, box] = random_encounter(GetParam(), random);
    const BoxPoints<double> found = points_with_box(one, box, 0.1);
    const bool boxes = GetParam() == ShapeKind::box;
    for (Index j = 0; j < found.count; ++j) {
      const ContactCandidate<double>& point = found.at[j];
      EXPECT_NEAR(length(point.normal), 1, kFew);
      // Points of boxes that are apart, and of a capsule's middle line in a box, are not those of a distance.
      if (boxes ? point.depth < 0 : point.depth > one.size[0]) continue;
      const Point on_one = add_scaled(point.point, 0.5 * point.depth, point.normal);
      const Point on_box = add_scaled(point.point, -0.5 * point.depth, point.normal);
      EXPECT_LE(distance_to_surface(one, on_one), 1e-9) << "case " << k << ", point " << j;
      EXPECT_LE(distance_to_surface(box, on_box), 1e-9) << "case " << k << ", point " << j;
      ++compared;
    }
  }
  EXPECT_GT(compared, 100);
}

TEST_P(EveryKind, NumbersThatAreNotFiniteEndInSomePoints) {
  std::mt19937_64 random(7);
  for (const double number : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1e300, 0.0})
    for (int place = 0; place < 6; ++place) {
      auto [one, box] = random_encounter(GetParam(), random);
      double* const numbers[] = {&one.centre.x, &one.axes.z.y, &one.axes.x.z,
                                 &box.centre.z, &box.axes.x.x, &box.axes.y.z};
      *numbers[place] = number;
      const BoxPoints<double> found = points_with_box(one, box, 0.1);
      EXPECT_GE(found.count, 0);
      EXPECT_LE(found.count, kBoxPoints);
    }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryKind, testing::Values(ShapeKind::sphere, ShapeKind::capsule, ShapeKind::box));

TEST(SphereInABox, LeavesByTheNearestFace) {
  const Shape box = shape_of(ShapeKind::box, {1, 2, 3});
  for (const double side : {-1.0, 1.0}) {
    const Shape sphere = shape_of(ShapeKind::sphere, {0.5, 0, 0}, {0.2, 1.6 * side, 0});
    const BoxPoints<double> found = points_with_box(sphere, box, 0.0);
    ASSERT_EQ(found.count, 1);
    EXPECT_NEAR(found.at[0].depth, 0.9, kFew);
    EXPECT_EQ(found.at[0].normal.y, -side);
    EXPECT_NEAR(found.at[0].point.y, 1.55 * side, kFew);  // between 2 and 1.1
  }
}

TEST(CapsuleOnABox, TouchesAtBothEndsOfWhatIsOverTheFace) {
  const Shape box = shape_of(ShapeKind::box, {1, 1, 1});
  const Quaternion<double> along_x{std::sqrt(0.5), 0, std::sqrt(0.5), 0};
  const Shape capsule = shape_of(ShapeKind::capsule, {0.1, 0.8, 0}, {0.6, 0.3, 1.05}, along_x);
  const BoxPoints<double> found = points_with_box(capsule, box, 0.0);
  ASSERT_EQ(found.count, 2);
  const auto [low, high] = std::minmax(found.at[0].point.x, found.at[1].point.x);
  EXPECT_NEAR(low, -0.2, kFew);
  EXPECT_NEAR(high, 1, kFew);  // where the box ends
  for (const auto& point : {found.at[0], found.at[1]}) {
    EXPECT_NEAR(point.depth, 0.05, kFew);
    EXPECT_NEAR(point.normal.z, -1, kFew);
  }
}

TEST(BoxOnABox, TouchesInTheCornersOfWhatIsShared) {
  const Shape under = shape_of(ShapeKind::box, {1, 1, 1});
  const Shape over = shape_of(ShapeKind::box, {1, 1, 1}, {0.5, 0.25, 1.99});
  const BoxPoints<double> found = points_with_box(under, over, 0.0);
  ASSERT_EQ(found.count, 4);
  for (Index k = 0; k < 4; ++k) {
    EXPECT_NEAR(found.at[k].depth, 0.01, kFew);
    EXPECT_NEAR(found.at[k].normal.z, 1, kFew);
    EXPECT_NEAR(std::abs(found.at[k].point.x - 0.25), 0.75, kFew);
    EXPECT_NEAR(std::abs(found.at[k].point.y - 0.125), 0.875, kFew);
  }
  const Shape turned = shape_of(ShapeKind::box, {1, 1, 1}, {0, 0, 1.99}, {std::cos(0.4), 0, 0, std::sin(0.4)});
  EXPECT_EQ(points_with_box(under, turned, 0.0).count, 8);
  EXPECT_EQ(points_with_box(under, shape_of(ShapeKind::box, {1, 1, 1}, {0, 0, 2.01}), 0.0).count, 0);
}

TEST(BoxesWhoseEdgesCross, TouchInOnePoint) {
  const Quaternion<double> about_x{std::cos(M_PI / 8), std::sin(M_PI / 8), 0, 0};
  const Quaternion<double> about_y{std::cos(M_PI / 8), 0, std::sin(M_PI / 8), 0};
  const double height = 2 * std::sqrt(2.0) - 0.02;
  const Shape under = shape_of(ShapeKind::box, {1, 1, 1}, {0, 0, 0}, about_x);
  const Shape over = shape_of(ShapeKind::box, {1, 1, 1}, {0.1, -0.2, height}, about_y);
  const BoxPoints<double> found = points_with_box(under, over, 0.0);
  ASSERT_EQ(found.count, 1);
  EXPECT_NEAR(found.at[0].depth, 0.02, kFew);
  EXPECT_NEAR(found.at[0].normal.z, 1, kFew);
  EXPECT_NEAR(found.at[0].point.x, 0.1, kFew);
  EXPECT_NEAR(found.at[0].point.y, 0, kFew);
}

}  // namespace

}  // namespace stiction::test
