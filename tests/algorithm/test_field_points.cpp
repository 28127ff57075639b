// Points of height fields with spheres, capsules and boxes.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <vector>

#include "core/algorithm/articulated/fields/touch_field.hpp"
#include "tests/support/systems/placed_shapes.hpp"

namespace stiction::test {

namespace {

constexpr double kFew = 1e-12;

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
  slope.grid().for_each_top({-1, -1, -1}, {1, 1, 1}, [&](const Triangle3<double>& top) {
    ++prisms;
    volume += .01 * ((top.a.z + top.b.z + top.c.z) / 3 + .3);
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
      rough.grid().for_each_top(from, to, [&](const Triangle3<double>& top) {
        const auto& [p, q, r] = top;
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
  const FieldGrid<double> grid = ground.grid();
  FieldTouch<double> touch(grid, pair, placed);
  touch.add(0, frame, placed);
  touch.finish();
  const FieldPoints<double>& found = touch.points(0, frame);
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
  rough.grid().for_each_top({-1, -1, -1}, {1, 1, 1}, [&](const Triangle3<double>& top) {
    const double depth = .3 - nearest_surface(FieldPrism<double>(top, -.3), ball.centre).distance;
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

std::array<std::uint64_t, 7> bits_of(const ContactCandidate<double>& c) {
  const auto bits = [](double x) { return stiction::bits_of(x); };
  return {bits(c.point.x),  bits(c.point.y),  bits(c.point.z), bits(c.normal.x),
          bits(c.normal.y), bits(c.normal.z), bits(c.depth)};
}

TEST(FieldPoints, LanesHaveThePointsOfTheirShapesAlone) {
  using Wide = Pack<double, 4>;
  std::mt19937_64 random(13);
  std::uniform_real_distribution<double> height(0, .2);
  const Ground rough([&](double, double) { return height(random); });
  const FieldGrid<double> grid = rough.grid();
  const Shape frame = shape_of(ShapeKind::box, {0, 0, 0}, {.1, -.2, .3});
  ArticulatedPairData<double> pair{};
  pair.points = kMostFieldPoints;
  pair.margin = .02;
  std::map<Index, int> lanes_with;  // so many points
  for (int k = 0; k < 200; ++k) {
    Shape shapes[4];
    for (Shape& shape : shapes) {
      const Point turn = random_point(random, 1);
      shape = shape_of(k % 3 == 0 ? ShapeKind::sphere : ShapeKind::capsule, {.04, .12, 0},
                       added(Point{.1, -.2, .4}, random_point(random, .3)),
                       normalised(Quaternion<double>{1, turn.x, turn.y, turn.z}));
    }
    FieldTouch<Wide> together(grid, pair, shapes[0]);
    for (int lane : {0, 1, 3}) together.add(lane, frame, shapes[lane]);
    together.finish();
    EXPECT_EQ(together.points(2, frame).count, 0);
    for (int lane : {0, 1, 3}) {
      FieldTouch<double> alone(grid, pair, shapes[lane]);
      alone.add(0, frame, shapes[lane]);
      alone.finish();
      const auto &one = alone.points(0, frame), &other = together.points(lane, frame);
      ASSERT_EQ(one.count, other.count) << k;
      EXPECT_EQ(one.is_full, other.is_full) << k;
      for (Index i = 0; i < one.count; ++i) EXPECT_EQ(bits_of(one.at[i]), bits_of(other.at[i])) << k;
      ++lanes_with[one.count];
    }
  }
  for (Index count : {0, 1, 2, 4, 8}) EXPECT_GT(lanes_with[count], 5) << count;
}

}  // namespace

}  // namespace stiction::test
