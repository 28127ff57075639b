// Points of triangles and prisms that are nearest to points and segments. Conditions that hold for the nearest point of
// a convex set alone judge them, and searches.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "core/algorithm/articulated/fields/prism_queue.hpp"
#include "tests/support/systems/placed_shapes.hpp"

namespace stiction::test {

namespace {

constexpr double kFew = 1e-12;

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
  return prism.foot_on_outermost(p).distance;
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
    FieldPoints<double> found;
    found.room = kMostFieldPoints;
    PrismQueue<double>(true, kRadius, 10, -.2, &found).add(0, ends.axis, prism.part(0, 0));
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

TEST(FieldPrism, OnlySegmentsFartherThanThatArePartedFromIt) {
  std::mt19937_64 random(12);
  std::uniform_real_distribution<double> reach(.01, .3);
  int parted = 0, seen = 0;
  for (int k = 0; k < 3000; ++k) {
    const FieldPrism<double> prism = random_prism(random);
    const Ends<double> ends({added(Point{.2, .2, .3}, random_point(random, .6)), random_point(random, .3)});
    const double most = reach(random);
    if (is_near(prism, ends, most)) {
      EXPECT_FALSE(is_beyond(prism.part(0, 0), ends, most)) << k;
      continue;
    }
    EXPECT_GE(searched_distance(prism, ends.axis), most - kFew) << k;
    ++parted;
    seen += is_beyond(prism.part(0, 0), ends, most) ? 1 : 0;
  }
  EXPECT_GT(parted, 500);
  EXPECT_GT(seen, parted * 9 / 10);  // the rest is below the bottom, or hardly farther
}

TEST(FieldPrism, ASegmentAHairAboveItsTopPiercesNothing) {
  const FieldPrism<double> prism({{0, .4, -1e-20}, {0, 0, -1e-20}, {.5, .4, -1e-20}}, -.2);
  for (const double up : {.5, -.5}) EXPECT_FALSE(pierces(Ends<double>({{.1, .3, .5}, {0, 0, up}}), prism));
}

/// The distance from the top's plane is one root away from that of the nearest point, which may be less.
TEST(FieldPrism, ABallAsFarAsItsRadiusFromTheTopHasNoPoint) {
  std::mt19937_64 random(14);
  int rounded_down = 0;
  for (int k = 0; k < 300; ++k) {
    const FieldPrism<double> prism = random_prism(random);
    const Point centre = added(Point{.2, .25, .8}, random_point(random, .05));
    const double radius = prism.beyond(0, centre);
    rounded_down += nearest_surface(prism, centre).distance < radius ? 1 : 0;
    FieldPoints<double> found;
    found.room = kMostFieldPoints;
    PrismQueue<double>(false, radius, 0, -.2, &found).add(0, {centre, {}}, prism.part(0, 0));
    EXPECT_EQ(found.count, 0) << k;
  }
  EXPECT_GT(rounded_down, 20);
}

}  // namespace

}  // namespace stiction::test
