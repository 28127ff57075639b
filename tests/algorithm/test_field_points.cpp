// Points of height fields with spheres, capsules and boxes, against conditions that hold for the nearest point of a
// convex set alone, and against searches.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <tuple>
#include <vector>

#include "core/algorithm/articulated/fields/touch_field.hpp"
#include "tests/support/systems/placed_shapes.hpp"

namespace stiction::test {

namespace {

constexpr double kFew = 1e-12;

Point random_point(std::mt19937_64& random, double size) {
  std::uniform_real_distribution<double> place(-size, size);
  const double x = place(random), y = place(random), z = place(random);
  return {x, y, z};
}

/// Holds for the point of a convex set that is nearest to p, and for no other: the set is behind it.
template <class Corners>
void expect_nearest(const Point& p, const Point& found, const Corners& corners) {
  for (const Point& corner : corners) EXPECT_LE(dot(subtract(p, found), subtract(corner, found)), kFew);
}

TEST(Triangle, HasTheNearestPointInItself) {
  std::mt19937_64 random(5);
  for (int k = 0; k < 2000; ++k) {
    const Triangle3<double> triangle{random_point(random, 1), random_point(random, 1), random_point(random, 1)};
    const Point p = random_point(random, 2), found = nearest_in(triangle, p);
    expect_nearest(p, found, std::vector<Point>{triangle.a, triangle.b, triangle.c});
    // Areas of the parts that it cuts the triangle into make the triangle's.
    const auto area = [](const Point& a, const Point& b, const Point& c) {
      return length(cross(subtract(b, a), subtract(c, a)));
    };
    EXPECT_NEAR(
        area(triangle.a, triangle.b, found) + area(triangle.b, triangle.c, found) + area(triangle.c, triangle.a, found),
        area(triangle.a, triangle.b, triangle.c), 1e-7);
  }
}

FieldPrism<double> random_prism(std::mt19937_64& random) {
  std::uniform_real_distribution<double> height(0, 0.6);
  const double a = height(random), b = height(random), c = height(random);
  return {{{0, .4, a}, {0, 0, b}, {.5, .4, c}}, -.2};
}

double farthest_beyond(const FieldPrism<double>& prism, const Point& p) {
  return prism.beyond(prism.outermost_face(p), p);
}

TEST(FieldPrism, NearestPointOfItsSurfaceIsBehindOrLeavesByTheNearestFace) {
  std::mt19937_64 random(6);
  int outside = 0, inside = 0;
  for (int k = 0; k < 3000; ++k) {
    const FieldPrism<double> prism = random_prism(random);
    const Point p = added(Point{.2, .2, .1}, random_point(random, k % 2 == 0 ? .7 : .2));
    const SurfacePoint<double> found = nearest_surface(prism, p);
    EXPECT_NEAR(length(found.normal), 1, kFew);
    EXPECT_NEAR(farthest_beyond(prism, found.at), 0, kFew);
    EXPECT_NEAR(length(subtract(p, add_scaled(found.at, found.distance, found.normal))), 0, kFew);
    if (found.distance > 0) {
      ++outside;
      expect_nearest(p, found.at, prism.corner);
    } else {
      ++inside;  // a ball as large as the way out stays within
      for (int turn = 0; turn < 20; ++turn)
        EXPECT_LE(farthest_beyond(prism, add_scaled(p, -found.distance, random_direction(random))), kFew);
    }
  }
  EXPECT_GT(outside, 500);
  EXPECT_GT(inside, 300);
}

/// The distance from a segment to a prism by a search that halves: it is convex along the segment.
double searched_distance(const FieldPrism<double>& prism, const Segment<double>& axis) {
  double low = -1, high = 1;
  const auto at = [&](double t) { return nearest_surface(prism, point_at(axis, t)).distance; };
  for (int k = 0; k < 200; ++k) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (at(a) < at(b) ? high : low) = at(a) < at(b) ? b : a;
  }
  return at(low);
}

/// How far a prism has to go along n until it is behind a segment.
double way_along(const FieldPrism<double>& prism, const Ends<double>& ends, const Point& n) {
  return prism.reach(n) - std::min(dot(n, ends.at[0]), dot(n, ends.at[1]));
}

TEST(FieldPrism, ACapsuleTouchesItWhereASearchFindsTheSegmentNearest) {
  constexpr double kRadius = .05;
  std::mt19937_64 random(7);
  int apart = 0, pierced = 0, between = 0;
  for (int k = 0; k < 3000; ++k) {
    const FieldPrism<double> prism = random_prism(random);
    const Ends<double> ends({added(Point{.2, .2, .3}, random_point(random, .4)), random_point(random, .3)});
    FieldPoints<double> found(kMostFieldPoints);
    touch_prism(prism, ends, kRadius, 10.0, found);
    ASSERT_GE(found.count, 1);
    ASSERT_LE(found.count, 3);
    const auto& deepest = *std::max_element(found.at, found.at + found.count,
                                            [](const auto& one, const auto& other) { return one.depth < other.depth; });
    const double distance = kRadius - deepest.depth;
    const double way = way_along(prism, ends, deepest.normal);
    EXPECT_NEAR(way, -distance, 1e-9) << k;  // the distance is that along the normal
    const Point surface = add_scaled(deepest.point, deepest.depth / 2, deepest.normal);
    const Point middle = add_scaled(surface, distance, deepest.normal);
    EXPECT_NEAR(farthest_beyond(prism, surface), 0, kFew) << k;
    EXPECT_NEAR(length(subtract(point_at(ends.axis, nearest_on(ends.axis, middle)), middle)), 0, 1e-9) << k;
    if (!pierces(ends, prism)) {
      ++apart;
      EXPECT_NEAR(distance, searched_distance(prism, ends.axis), 1e-7) << k;
      const double own =
          std::min(nearest_surface(prism, ends.at[0]).distance, nearest_surface(prism, ends.at[1]).distance);
      if (distance < own - 1e-6) ++between;
    } else {
      ++pierced;
      for (int turn = 0; turn < 300; ++turn) {
        EXPECT_GE(way_along(prism, ends, random_direction(random)), way - kFew);
        const Point near = added(deepest.normal, scaled(.05, random_direction(random)));
        EXPECT_GE(way_along(prism, ends, scaled(1 / length(near), near)), way - kFew);
      }
    }
  }
  EXPECT_GT(apart, 500);
  EXPECT_GT(pierced, 500);
  EXPECT_GT(between, 100);
}

/// Heights of a field of 5 by 7, cells of .2 by .1.
struct Ground {
  std::vector<double> heights;
  ArticulatedFieldData<double> data{5, 7, 0, {.6, .2}, {.2, .1}, .3};

  explicit Ground(const std::function<double(double, double)>& height) {
    for (Index row = 0; row < 5; ++row)
      for (Index column = 0; column < 7; ++column) heights.push_back(height(.2 * column - .6, .1 * row - .2));
  }
  [[nodiscard]] FieldGrid<double> grid() const { return {data, heights.data()}; }
};

TEST(FieldGrid, ItsTrianglesTileThePlaneAndFollowHeights) {
  const Ground slope([](double x, double y) { return .3 + .5 * x - .25 * y; });
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> x(-.6, .6), y(-.2, .2);
  for (int k = 0; k < 1000; ++k) {
    const Point p{x(random), y(random), 0};
    const FieldPrism<double> prism(slope.grid().triangle_at(p), -.3);
    EXPECT_TRUE(prism.is_level_with(p));
    EXPECT_NEAR(prism.beyond(0, {p.x, p.y, .3 + .5 * p.x - .25 * p.y}), 0, kFew);
  }
  Index prisms = 0;
  double volume = 0;
  slope.grid().for_each_prism({-1, -1, -1}, {1, 1, 1}, [&](const FieldPrism<double>& prism) {
    ++prisms;
    const auto& c = prism.corner;
    volume += .01 * ((c[0].z + c[1].z + c[2].z) / 3 + .3);
  });
  EXPECT_EQ(prisms, 4 * 6 * 2);
  EXPECT_NEAR(volume, 1.2 * .4 * .6, kFew);
}

TEST(FieldGrid, ABoxHasThePrismsOfItsCellsThatReachUpToIt) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> height(0, .3);
  const Ground rough([&](double, double) { return height(random); });
  for (int k = 0; k < 300; ++k) {
    const Point a = random_point(random, .7), b = random_point(random, .7);
    const Point low{std::min(a.x, b.x), std::min(a.y, b.y), std::fabs(a.z) / 2};
    const Point high{std::max(a.x, b.x), std::max(a.y, b.y), low.z + 1};
    const auto corners_of = [&](const Point& from, const Point& to, bool has_all) {
      std::vector<double> found;
      rough.grid().for_each_prism(from, to, [&](const FieldPrism<double>& prism) {
        const auto& [p, q, r] = std::tie(prism.corner[0], prism.corner[1], prism.corner[2]);
        const bool is_apart = std::min({p.x, q.x, r.x}) > high.x || std::max({p.x, q.x, r.x}) < low.x ||
                              std::min({p.y, q.y, r.y}) > high.y || std::max({p.y, q.y, r.y}) < low.y ||
                              std::max({p.z, q.z, r.z}) < low.z;
        if (!has_all || !is_apart) found.push_back(p.x + 10 * p.y + 100 * q.x + 1000 * q.y);
      });
      return found;
    };
    EXPECT_EQ(corners_of(low, high, false), corners_of({-1, -1, -1}, {1, 1, 1}, true)) << k;
  }
}

TEST(FieldGrid, RidgesArePointsAboveTheirNeighbours) {
  const Ground slope([](double x, double y) { return .3 + .5 * x - .25 * y; });
  const Ground roof([](double x, double) { return .3 - std::fabs(x); }), valley([](double, double y) { return y * y; });
  const Ground saddle([](double x, double y) { return .3 + y * y - x * x; });
  for (Index row = 1; row < 4; ++row)
    for (Index column = 1; column < 6; ++column) {
      EXPECT_FALSE(slope.grid().is_ridge(row, column));
      EXPECT_EQ(roof.grid().is_ridge(row, column), column == 3);
      EXPECT_FALSE(valley.grid().is_ridge(row, column));
      EXPECT_FALSE(saddle.grid().is_ridge(row, column));
    }
  EXPECT_TRUE(slope.grid().is_ridge(0, 3));  // where the field ends
}

/// A shape in a lane of its own, over ground that lies turned.
std::vector<ContactCandidate<double>> points_of(const Ground& ground, const Shape& shape, Index room,
                                                bool* is_full = nullptr) {
  const Shape frame =
      shape_of(ShapeKind::box, {0, 0, 0}, {.1, -.2, .3}, normalised(Quaternion<double>{1, .2, -.3, .1}));
  ArticulatedPairData<double> pair{};
  pair.points = room;
  pair.margin = pair.reach = .01;
  Shape placed = shape;
  placed.centre = added(frame.centre, along(frame.axes, shape.centre));
  for (Point* axis : {&placed.axes.x, &placed.axes.y, &placed.axes.z}) *axis = along(frame.axes, *axis);
  const FieldPoints<double> found = points_on_field(ground.grid(), frame, placed, pair);
  if (is_full != nullptr) *is_full = found.is_full;
  std::vector<ContactCandidate<double>> points(found.at, found.at + found.count);
  for (auto& point : points) {
    point.point = components(frame.axes, subtract(point.point, frame.centre));
    point.normal = components(frame.axes, point.normal);
  }
  return points;
}

/// Over level ground at height .1 all has the points that it has on a plane.
TEST(FieldPoints, LevelGroundIsAPlane) {
  const Ground level([](double, double) { return .1; });
  const auto on_plane_at = [](const ContactCandidate<double>& point, double x, double y, double depth) {
    EXPECT_NEAR(length(subtract(point.normal, Point{0, 0, 1})), 0, kFew);
    EXPECT_NEAR(length(subtract(point.point, Point{x, y, .1 - depth / 2})), 0, kFew);
    EXPECT_NEAR(point.depth, depth, kFew);
  };
  const auto ball = points_of(level, shape_of(ShapeKind::sphere, {.01, 0, 0}, {.14, .03, .109}), 8);
  ASSERT_EQ(ball.size(), 1U);
  on_plane_at(ball[0], .14, .03, .001);
  const Quaternion<double> lying{std::sqrt(.5), 0, std::sqrt(.5), 0};  // its axis along x
  for (const double depth : {.001, .015}) {                            // the middle line above the ground, and in it
    const auto log = points_of(level, shape_of(ShapeKind::capsule, {.01, .03, 0}, {.14, .025, .11 - depth}, lying), 16);
    ASSERT_EQ(log.size(), 2U);
    const std::size_t left = log[0].point.x < log[1].point.x ? 0 : 1;
    on_plane_at(log[left], .11, .025, depth);
    on_plane_at(log[1 - left], .17, .025, depth);
  }
  const auto crate = points_of(level, shape_of(ShapeKind::box, {.15, .05, .02}, {.1, .04, .117}), 4);
  ASSERT_EQ(crate.size(), 4U);
  for (std::size_t k = 0; k < 4; ++k) on_plane_at(crate[k], k % 2 == 0 ? -.05 : .25, k < 2 ? -.01 : .09, .003);
  EXPECT_TRUE(points_of(level, shape_of(ShapeKind::box, {.15, .05, .02}, {.1, .04, .131}), 4).empty());
  // Sunk and upside down its first four corners are above its centre.
  const auto sunk = points_of(level, shape_of(ShapeKind::box, {.15, .05, .02}, {.1, .04, .07}, {0, 1, 0, 0}), 4);
  ASSERT_EQ(sunk.size(), 4U);
  for (const auto& point : sunk) EXPECT_NEAR(point.depth, .05, kFew);
}

TEST(FieldPoints, ALogOverManyTrianglesHasOnePointOnEachAndNoneBesideIt) {
  const Ground level([](double, double) { return .1; });
  const Quaternion<double> lying{std::sqrt(.5), 0, std::sqrt(.5), 0};
  const auto log = points_of(level, shape_of(ShapeKind::capsule, {.01, .25, 0}, {.08, .025, .109}, lying), 16);
  EXPECT_EQ(log.size(), 6U);
  for (const auto& point : log) {
    EXPECT_NEAR(point.normal.z, 1, kFew);
    EXPECT_NEAR(point.depth, .001, kFew);
  }
}

TEST(FieldPoints, ALogOnARidgeTouchesItInItsMiddle) {
  const Ground ridge([](double x, double) { return std::fabs(x) < .1 ? .15 : 0.0; });  // along y
  const Quaternion<double> lying{std::sqrt(.5), 0, std::sqrt(.5), 0};
  const auto log = points_of(ridge, shape_of(ShapeKind::capsule, {.02, .1, 0}, {.03, .05, .168}, lying), 16);
  ASSERT_GE(log.size(), 2U);
  for (const auto& point : log) {
    EXPECT_NEAR(point.depth, .002, kFew);
    EXPECT_NEAR(point.point.x, 0, kFew);
    EXPECT_NEAR(point.normal.z, 1, kFew);
  }
}

TEST(FieldPoints, ACrateOnAPeakIsHeldThere) {
  const Ground peak([](double x, double y) { return std::fabs(x) < .1 && std::fabs(y) < .05 ? .15 : 0.0; });
  for (const double depth : {.002, -.008}) {
    const auto crate =
        points_of(peak, shape_of(ShapeKind::box, {.1, .08, .02}, {.02, .01, .17 - depth}), kMostFieldPoints);
    ASSERT_EQ(crate.size(), 1U);
    EXPECT_NEAR(length(subtract(crate[0].normal, Point{0, 0, 1})), 0, kFew);
    EXPECT_NEAR(length(subtract(crate[0].point, Point{0, 0, .15 - depth / 2})), 0, kFew);
    EXPECT_NEAR(crate[0].depth, depth, kFew);
  }
}

TEST(FieldPoints, WithoutRoomTheDeepestStayAndItIsSaid) {
  const Ground rough([](double x, double y) { return .05 * std::sin(40 * x) * std::sin(60 * y) + .05; });
  const Shape ball = shape_of(ShapeKind::sphere, {.3, 0, 0}, {.05, .02, .3});
  std::vector<double> depths;
  rough.grid().for_each_prism({-1, -1, -1}, {1, 1, 1}, [&](const FieldPrism<double>& prism) {
    const double depth = .3 - nearest_surface(prism, ball.centre).distance;
    if (depth > -.01) depths.push_back(depth);
  });
  std::sort(depths.rbegin(), depths.rend());
  ASSERT_GT(depths.size(), 8U);
  bool is_full = false;
  const auto found = points_of(rough, ball, 8, &is_full);
  EXPECT_TRUE(is_full);
  ASSERT_EQ(found.size(), 8U);
  double sum = 0, expected = 0;
  for (std::size_t k = 0; k < 8; ++k) {
    sum += found[k].depth;
    expected += depths[k];
  }
  EXPECT_NEAR(sum, expected, kFew);
}

}  // namespace

}  // namespace stiction::test
