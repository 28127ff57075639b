// Contacts of two shapes, against hand answers and against convexity. The signed distance is the largest gap along any
// direction, which a search over directions finds without looking at faces, edges or corners.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "tests/support/systems/placed_shapes.hpp"

namespace stiction::test {

namespace {

constexpr double kFar = 10;  // a margin that keeps every point
constexpr double kFew = 1e-12;

/// A random shape of a kind, sizes within a factor of five.
Shape random_shape(ShapeKind kind, std::mt19937_64& random) {
  std::uniform_real_distribution<double> size(0.1, 0.5);
  const double x = size(random), y = size(random), z = size(random);
  return shape_of(kind, {x, y, z}, {0, 0, 0}, random_turn(random));
}

/// Two shapes that overlap a little or are a little apart.
struct Encounter {
  Shape a, b;
};
Encounter random_encounter(ShapeKind one, ShapeKind other, std::mt19937_64& random) {
  Encounter pair{random_shape(one, random), random_shape(other, random)};
  const Point n = random_direction(random);
  std::uniform_real_distribution<double> gap(-0.16, 0.04);
  const double at = support(pair.a, n) + support(pair.b, scaled(-1.0, n)) + gap(random);
  pair.b.centre = scaled(at, n);
  return pair;
}

const char* name_of(ShapeKind kind) {
  constexpr const char* kNames[] = {"sphere", "capsule", "box", "plane"};
  return kNames[static_cast<int>(kind)];
}

double smallest_size(const Shape& shape) {
  return std::min({shape.size[0], shape.size[1], shape.size[2]});
}

class EveryPair : public testing::TestWithParam<std::pair<ShapeKind, ShapeKind>> {};

}  // namespace

TEST_P(EveryPair, DeepestPointSaysTheSignedDistance) {
  const auto [one, other] = GetParam();
  std::mt19937_64 random(20260);
  const bool boxes = one == ShapeKind::box && other == ShapeKind::box;
  int overlapping = 0;
  for (int k = 0; k < 60; ++k) {
    const auto [a, b] = random_encounter(one, other, random);
    const double exact = signed_distance(a, b);
    const Manifold<double> found = collide(a, b, kFar);
    overlapping += exact < 0 ? 1 : 0;
    if (boxes && exact > 0 && found.count == 0) continue;  // apart, and nothing of one over the other's face
    ASSERT_GE(found.count, 1) << "case " << k;
    const double distance = -deepest(found);
    if (!boxes) {
      // No direction parts them more, and the normal parts them so much: together that is the definition. A capsule
      // that lies on a face within kFaceCosine is that much off. The search stops a little below the largest.
      const Point n = deepest_point(found).normal;
      const double lying = one == ShapeKind::capsule && other == ShapeKind::box ? 2e-4 : 1e-9;
      EXPECT_NEAR(gap_along(a, b, n), distance, lying) << "case " << k;
      EXPECT_LE(exact, distance + lying) << "case " << k;
      EXPECT_NEAR(exact, distance, 1e-3) << "case " << k;
      continue;
    }
    // Boxes: the bias towards faces may cost that much. A gap is one along a direction of faces or edges, no more than
    // the distance; the points may lie beside where it is smallest.
    const double bias = kAxisBias * std::min(smallest_size(a), smallest_size(b));
    const double gap = gap_along(a, b, deepest_point(found).normal);
    EXPECT_LE(gap, distance + 1e-9) << "case " << k;
    if (exact < 0) {
      EXPECT_GE(gap, exact - 2 * bias) << "case " << k;
      EXPECT_LE(distance, gap + 2 * bias) << "case " << k;
    }
  }
  EXPECT_GE(overlapping, 10);
}

TEST_P(EveryPair, PointsLieHalfwayBetweenTheSurfacesAlongAUnitNormal) {
  const auto [one, other] = GetParam();
  std::mt19937_64 random(4711);
  for (int k = 0; k < 200; ++k) {
    const auto [a, b] = random_encounter(one, other, random);
    const Manifold<double> found = collide(a, b, 0.1);
    for (Index j = 0; j < found.count; ++j) {
      const ContactCandidate<double>& point = found.at[j];
      EXPECT_NEAR(length(point.normal), 1, kFew);
      const bool separated_boxes = one == ShapeKind::box && other == ShapeKind::box && point.depth < 0;
      if (separated_boxes) continue;  // their gap is not the distance of two surface points
      const Point on_a = add_scaled(point.point, 0.5 * point.depth, point.normal);
      const Point on_b = add_scaled(point.point, -0.5 * point.depth, point.normal);
      // A capsule that lies on a face within kFaceCosine touches it in points that are that much off its surface. One
      // whose middle is inside a box touches it with points below its ends, of which the upper one is inside itself.
      const bool lies = one == ShapeKind::capsule && other == ShapeKind::box;
      const double tolerance = lies ? 2e-4 : 1e-9;
      EXPECT_NEAR(distance_to_surface(b, on_b), 0, tolerance) << "case " << k << ", point " << j;
      EXPECT_LE(distance_to_surface(a, on_a), tolerance) << "case " << k << ", point " << j;
      if (!lies || point.depth == deepest(found)) {
        EXPECT_NEAR(distance_to_surface(a, on_a), 0, tolerance) << "case " << k << ", point " << j;
      }
    }
  }
}

TEST_P(EveryPair, ContactsAreThoseOfTheSwappedPairWithOppositeNormals) {
  const auto [one, other] = GetParam();
  std::mt19937_64 random(99);
  int compared = 0;
  for (int k = 0; k < 200; ++k) {
    const auto [a, b] = random_encounter(one, other, random);
    const Manifold<double> forth = collide(a, b, 0.1);
    const Manifold<double> back = collide(b, a, 0.1);
    if (forth.count == 0 && back.count == 0) continue;
    if (forth.count == 0 || back.count == 0) {
      // At the margin the bias may decide; boxes that are apart may be so beside each other's faces.
      EXPECT_LE(deepest(forth.count > 0 ? forth : back), one == other ? 0 : -0.09);
      continue;
    }
    const double bias = kAxisBias * std::min(smallest_size(a), smallest_size(b));
    EXPECT_NEAR(deepest(forth), deepest(back), one == other ? 2 * bias : 1e-9) << "case " << k;
    const double agreement = -dot(forth.at[0].normal, back.at[0].normal);
    if (agreement > 1 - 1e-9) ++compared;
    if (one != other) {
      EXPECT_NEAR(agreement, 1, 1e-9);
    }
  }
  EXPECT_GE(compared, 120);
}

TEST_P(EveryPair, FeaturesAscendAndStayInRange) {
  const auto [one, other] = GetParam();
  std::mt19937_64 random(5);
  for (int k = 0; k < 300; ++k) {
    const auto [a, b] = random_encounter(one, other, random);
    const Manifold<double> found = collide(a, b, kFar);
    ASSERT_LE(found.count, kManifoldPoints);
    for (Index j = 0; j < found.count; ++j) {
      EXPECT_GE(found.at[j].feature, j == 0 ? 0 : found.at[j - 1].feature + 1);
      EXPECT_LT(found.at[j].feature, kFeatures);
    }
  }
}

using Kinds = std::pair<ShapeKind, ShapeKind>;
INSTANTIATE_TEST_SUITE_P(
    Collide, EveryPair,
    testing::Values(Kinds{ShapeKind::sphere, ShapeKind::sphere}, Kinds{ShapeKind::sphere, ShapeKind::capsule},
                    Kinds{ShapeKind::capsule, ShapeKind::capsule}, Kinds{ShapeKind::sphere, ShapeKind::box},
                    Kinds{ShapeKind::capsule, ShapeKind::box}, Kinds{ShapeKind::box, ShapeKind::box}),
    [](const auto& pair) { return std::string(name_of(pair.param.first)) + "_" + name_of(pair.param.second); });

TEST(Collide, APlaneIsTouchedByTheLowestPoints) {
  std::mt19937_64 random(3);
  for (int k = 0; k < 100; ++k) {
    const Shape plane = shape_of(ShapeKind::plane, {0, 0, 0}, {0.3, -0.2, 0.1}, random_turn(random));
    for (const ShapeKind kind : {ShapeKind::sphere, ShapeKind::capsule, ShapeKind::box}) {
      Shape shape = random_shape(kind, random);
      const Point down = scaled(-1.0, plane.axes.z);
      shape.centre = add_scaled(plane.centre, support(shape, down) + 0.01, plane.axes.z);
      const Manifold<double> found = collide(plane, shape, 0.5);
      ASSERT_GE(found.count, 1);
      EXPECT_NEAR(deepest(found), -0.01, 1e-12);
      for (Index j = 0; j < found.count; ++j) {
        const Point on_shape = add_scaled(found.at[j].point, -0.5 * found.at[j].depth, found.at[j].normal);
        // Below the upper end of a tilted capsule is its side.
        EXPECT_LE(distance_to_surface(shape, on_shape), 1e-12);
        if (found.at[j].depth == deepest(found)) {
          EXPECT_NEAR(distance_to_surface(shape, on_shape), 0, 1e-12);
        }
        EXPECT_NEAR(distance_to_surface(plane, on_shape), -found.at[j].depth, 1e-12);
      }
    }
  }
}

TEST(Collide, ABoxOnABoxHasTheFourCornersOfTheOverlap) {
  const Shape below = shape_of(ShapeKind::box, {1, 2, 0.5});
  const Shape above = shape_of(ShapeKind::box, {0.5, 3, 0.25}, {0.8, 0, 0.74});
  const Manifold<double> found = collide(below, above, 0.01);
  ASSERT_EQ(found.count, 4);
  int corners = 0;
  for (const auto& point : found.at) {
    EXPECT_NEAR(point.depth, 0.01, kFew);
    EXPECT_NEAR(point.normal.z, 1, kFew);
    EXPECT_NEAR(point.point.z, 0.495, kFew);
    // Overlap: x from 0.3 to 1, y from -2 to 2.
    EXPECT_TRUE(std::abs(point.point.x - 0.3) < kFew || std::abs(point.point.x - 1) < kFew);
    EXPECT_NEAR(std::abs(point.point.y), 2, kFew);
    corners |= (point.point.x > 0.5 ? 1 : 2) << (point.point.y > 0 ? 0 : 2);
  }
  EXPECT_EQ(corners, 1 + 2 + 4 + 8);
}

TEST(Collide, EightCornersOfAnOctagonBecomeFourThatSpanIt) {
  const double half = std::sqrt(0.5);
  const Quaternion<double> eighth{std::sqrt((1 + half) / 2), 0, 0, std::sqrt((1 - half) / 2)};
  const Manifold<double> found =
      collide(shape_of(ShapeKind::box, {1, 1, 1}), shape_of(ShapeKind::box, {1, 1, 1}, {0, 0, 1.99}, eighth), 0.0);
  ASSERT_EQ(found.count, 4);
  // The octagon's area is 8 (sqrt 2 - 1) = 3.31; the quadrilateral of any four corners that is largest has 2.34.
  double x_low = 9, x_high = -9, y_low = 9, y_high = -9;
  for (const auto& point : found.at) {
    x_low = std::min(x_low, point.point.x), x_high = std::max(x_high, point.point.x);
    y_low = std::min(y_low, point.point.y), y_high = std::max(y_high, point.point.y);
  }
  EXPECT_GT(x_high - x_low, 1.4);
  EXPECT_GT(y_high - y_low, 1.4);
}

TEST(Collide, CrossedEdgesTouchInOnePoint) {
  // Two bars on their edges, crosswise, each turned by 45 degrees about its own axis.
  const double c = std::sqrt((1 + std::sqrt(0.5)) / 2), s = std::sqrt((1 - std::sqrt(0.5)) / 2);
  const double top = std::sqrt(2.0) * 0.1;
  const Shape along_x = shape_of(ShapeKind::box, {1, 0.1, 0.1}, {0, 0, 0}, {c, s, 0, 0});
  const Shape along_y = shape_of(ShapeKind::box, {0.1, 1, 0.1}, {0.2, 0.3, 2 * top - 0.02}, {c, 0, s, 0});
  const Manifold<double> found = collide(along_x, along_y, 0.0);
  ASSERT_EQ(found.count, 1);
  EXPECT_NEAR(found.at[0].depth, 0.02, 1e-9);
  EXPECT_NEAR(found.at[0].normal.z, 1, 1e-9);
  EXPECT_NEAR(found.at[0].point.x, 0.2, 1e-9);
  EXPECT_NEAR(found.at[0].point.y, 0, 1e-9);
  EXPECT_NEAR(found.at[0].point.z, top - 0.01, 1e-9);
}

TEST(Collide, ACapsuleLiesOnAFaceInTwoPointsAndStandsOnItInOne) {
  const Shape box = shape_of(ShapeKind::box, {1, 1, 0.5});
  const double half = std::sqrt(0.5);
  const Shape lying = shape_of(ShapeKind::capsule, {0.1, 0.8, 0}, {0.6, 0, 0.59}, {half, 0, half, 0});
  const Manifold<double> two = collide(box, lying, 0.001);
  ASSERT_EQ(two.count, 2);
  // The segment reaches from x = -0.2 to 1.4, the face to 1.
  EXPECT_NEAR(std::min(two.at[0].point.x, two.at[1].point.x), -0.2, 1e-9);
  EXPECT_NEAR(std::max(two.at[0].point.x, two.at[1].point.x), 1.0, 1e-9);
  for (Index k = 0; k < 2; ++k) EXPECT_NEAR(two.at[k].depth, 0.01, 1e-9);
  const Manifold<double> one = collide(box, shape_of(ShapeKind::capsule, {0.1, 0.8, 0}, {0, 0, 1.39}), 0.001);
  ASSERT_EQ(one.count, 1);
  EXPECT_NEAR(one.at[0].depth, 0.01, kFew);
}

TEST(Collide, ParallelCapsulesTouchAtBothEndsOfTheirOverlap) {
  const Shape a = shape_of(ShapeKind::capsule, {0.1, 0.5, 0});
  const Shape b = shape_of(ShapeKind::capsule, {0.2, 0.5, 0}, {0.29, 0, 0.4});
  const Manifold<double> found = collide(a, b, 0.0);
  ASSERT_EQ(found.count, 2);
  EXPECT_NEAR(found.at[0].point.z, -0.1, kFew);
  EXPECT_NEAR(found.at[1].point.z, 0.5, kFew);
  for (Index k = 0; k < 2; ++k) {
    EXPECT_NEAR(found.at[k].depth, 0.01, kFew);
    EXPECT_NEAR(found.at[k].normal.x, 1, kFew);
    EXPECT_NEAR(found.at[k].point.x, 0.095, kFew);
  }
}

TEST(Collide, ShapesWithOneCentrePartAlongSomeUnitNormal) {
  for (const ShapeKind one : {ShapeKind::sphere, ShapeKind::capsule, ShapeKind::box})
    for (const ShapeKind other : {ShapeKind::sphere, ShapeKind::capsule, ShapeKind::box}) {
      const Manifold<double> found = collide(shape_of(one, {0.2, 0.3, 0.4}), shape_of(other, {0.3, 0.2, 0.1}), 0.0);
      ASSERT_GE(found.count, 1);
      for (Index k = 0; k < found.count; ++k) {
        EXPECT_NEAR(length(found.at[k].normal), 1, kFew);
        EXPECT_GT(found.at[k].depth, 0);
        EXPECT_TRUE(std::isfinite(found.at[k].point.x + found.at[k].point.y + found.at[k].point.z));
      }
    }
}

}  // namespace stiction::test
