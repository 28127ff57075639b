// Points of hulls and cylinders against facts that need no search of their kind. A distance is proven by a plane that
// parts the shapes by as much. A depth is the least overlap along all normals of faces, and across all pairs of edges.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/algorithm/articulated/convex/touch_convex.hpp"
#include "core/runtime/articulated/hull_faces.hpp"
#include "tests/support/systems/hulls.hpp"
#include "tests/support/systems/placed_shapes.hpp"

namespace stiction::test {

namespace {

ArticulatedHull tetrahedron() {
  return {{{-.1, -.1, -.1}, {.3, 0, -.1}, {0, .25, -.05}, {.05, .02, .3}},
          {0, 3, 6, 9, 12},
          {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3}};
}

/// Shapes to choose from, in one model.
template <class T>
struct Shapes {
  std::vector<ArticulatedVertexData<T>> vertices;
  std::vector<ArticulatedFaceData<T>> faces;
  std::vector<Index> corners;
  std::vector<ArticulatedGeomData<T>> geoms;
  ArticulatedDescription description;
  ArticulatedModelView<T> model{};

  Shapes() {
    description.hulls = {prism(), tetrahedron()};
    const auto add = [&](GeomKind kind, T x, T y, T z, Index hull) {
      ArticulatedGeom from{0, kind, {}, {}, {1, 0, 0, 0}};
      from.hull = hull;
      ArticulatedGeomData<T> to{};
      to.kind = kind;
      to.size[0] = x, to.size[1] = y, to.size[2] = z;
      add_hull(description, from, to, vertices, faces, corners);
      geoms.push_back(to);
    };
    add(GeomKind::sphere, T(.1), 0, 0, -1);
    add(GeomKind::capsule, T(.08), T(.2), 0, -1);
    add(GeomKind::cylinder, T(.15), T(.12), 0, -1);
    add(GeomKind::box, T(.2), T(.1), T(.15), -1);
    add(GeomKind::mesh, 0, 0, 0, 0);
    add(GeomKind::mesh, 0, 0, 0, 1);
    model.vertex = vertices.data();
    model.face = faces.data();
    model.corner = corners.data();
  }
  [[nodiscard]] ConvexShape<T> shape(std::size_t which, const Vector3<T>& centre, const Quaternion<T>& turn) const {
    return {model, geoms[which], centre, axes_of(turn)};
  }
};
constexpr std::size_t kSphere = 0, kCapsule = 1, kCylinder = 2, kBox = 3, kPrism = 4, kShapes = 6;
constexpr double kExtent = 1.5;

/// Corners of a shape without round sides, in the world.
std::vector<Point> corners_of(const ConvexShape<double>& shape) {
  std::vector<Point> found;
  for (Index k = 0; shape.is(GeomKind::box) && k < 8; ++k)
    found.push_back(shape.placed(corner_of<double>(shape.geom.size, k)));
  for (Index v = shape.geom.hull_begin; v < shape.geom.hull_end; ++v) found.push_back(shape.placed(shape.vertex(v)));
  return found;
}

/// The largest coordinate along n, with the radius.
double reach_along(const ConvexShape<double>& shape, const Point& n) {
  const double centre = dot(shape.centre, n), rise = dot(shape.axes.z, n), *const size = shape.geom.size;
  if (shape.is(GeomKind::sphere)) return centre + size[0];
  if (shape.is(GeomKind::capsule)) return centre + size[0] + size[1] * std::abs(rise);
  if (shape.is(GeomKind::cylinder))
    return centre + size[1] * std::abs(rise) + size[0] * std::hypot(dot(shape.axes.x, n), dot(shape.axes.y, n));
  double most = -HUGE_VAL;
  for (const Point& p : corners_of(shape)) most = std::max(most, dot(p, n));
  return most;
}
double overlap_along(const ConvexShape<double>& a, const ConvexShape<double>& b, const Point& n) {
  return reach_along(a, n) + reach_along(b, scaled(-1.0, n));
}

/// How far a point is outside of a shape: 0 inside.
double outside(const ConvexShape<double>& shape, const Point& p) {
  const Point own = components(shape.axes, subtract(p, shape.centre));
  const double *const size = shape.geom.size, ring = std::hypot(own.x, own.y);
  if (shape.is(GeomKind::sphere)) return std::max(0.0, length(own) - size[0]);
  if (shape.is(GeomKind::capsule))
    return std::max(0.0, std::hypot(ring, own.z - std::clamp(own.z, -size[1], size[1])) - size[0]);
  if (shape.is(GeomKind::cylinder)) return std::max({0.0, ring - size[0], std::abs(own.z) - size[1]});
  if (shape.is(GeomKind::box))
    return std::max({0.0, std::abs(own.x) - size[0], std::abs(own.y) - size[1], std::abs(own.z) - size[2]});
  double most = 0;
  for (Index v = shape.geom.hull_begin; v < shape.geom.hull_end; ++v)
    for (Index f = shape.model.vertex[v].face_begin; f < shape.model.vertex[v].face_end; ++f)
      most = std::max(most, dot(in_lanes<double>(shape.model.face[f].normal), subtract(own, shape.vertex(v))));
  return most;
}

/// Normals of faces, and directions of edges: of a box and of a hull, in the world.
std::vector<Point> normals_of(const ConvexShape<double>& shape) {
  if (shape.is(GeomKind::box)) return {shape.axes.x, shape.axes.y, shape.axes.z};
  std::vector<Point> found;
  for (Index v = shape.geom.hull_begin; v < shape.geom.hull_end; ++v)
    for (Index f = shape.model.vertex[v].face_begin; f < shape.model.vertex[v].face_end; ++f)
      found.push_back(along(shape.axes, in_lanes<double>(shape.model.face[f].normal)));
  return found;
}
std::vector<Point> edges_of(const ConvexShape<double>& shape) {
  if (shape.is(GeomKind::box)) return {shape.axes.x, shape.axes.y, shape.axes.z};
  std::vector<Point> found;
  const std::vector<Point> corners = corners_of(shape);
  for (const Point& p : corners)  // more than its edges
    for (const Point& q : corners) found.push_back(subtract(p, q));
  return found;
}
double least_overlap(const ConvexShape<double>& a, const ConvexShape<double>& b) {
  double least = HUGE_VAL;
  const auto consider = [&](Point n) {
    const double size = length(n);
    if (size < 1e-9) return;
    n = scaled(1 / size, n);
    least = std::min({least, overlap_along(a, b, n), overlap_along(a, b, scaled(-1.0, n))});
  };
  for (const Point& n : normals_of(a)) consider(n);
  for (const Point& n : normals_of(b)) consider(n);
  for (const Point& one : edges_of(a))
    for (const Point& other : edges_of(b)) consider(cross(one, other));
  return least;
}

/// The closest points alone.
template <class T>
Encounter closest_of(const ConvexShape<T>& a, const ConvexShape<T>& b, T most, Closest<T>& found) {
  ConvexPair<T> pair{a, b, T(kExtent)};
  const Encounter encounter = separate(pair, most, found);
  EXPECT_TRUE(encounter != Encounter::overlapping || penetrate(pair, found));
  return encounter;
}

class EveryPair : public testing::TestWithParam<std::pair<std::size_t, std::size_t>> {
 protected:
  /// f(a, b) of shapes whose gap along a random direction is in a range.
  template <class F>
  void for_each(double low, double high, int count, F&& f) const {
    std::mt19937_64 random(20263);
    std::uniform_real_distribution<double> gap(low, high);
    for (int k = 0; k < count; ++k) {
      const auto a = shapes.shape(GetParam().first, {0, 0, 0}, random_turn(random));
      auto b = shapes.shape(GetParam().second, {0, 0, 0}, random_turn(random));
      const Point n = random_direction(random);
      b.centre = scaled(overlap_along(a, b, n) + gap(random), n);
      f(a, b);
    }
  }
  Shapes<double> shapes;
};

TEST_P(EveryPair, ADistanceIsProvenByAPlane) {
  int compared = 0;
  for_each(.001, .1, 300, [&](const auto& a, const auto& b) {
    Closest<double> found{};
    ASSERT_EQ(closest_of(a, b, 10.0, found), Encounter::near);
    EXPECT_NEAR(length(found.normal), 1, 1e-14);
    const double distance = length(subtract(found.b, found.a)), both = a.radius() + b.radius();
    EXPECT_NEAR(distance, found.distance, 1e-13);
    // Points of both are at most that far apart, and no plane with that normal leaves less between.
    const bool is_round = a.is(GeomKind::cylinder) || b.is(GeomKind::cylinder);
    EXPECT_NEAR(-overlap_along(a, b, found.normal), distance - both, is_round ? 1e-8 : 1e-12);
    EXPECT_LT(outside(a, add_scaled(found.a, a.radius(), found.normal)), 1e-9);
    EXPECT_LT(outside(b, add_scaled(found.b, -b.radius(), found.normal)), 1e-9);
    ++compared;
  });
  EXPECT_EQ(compared, 300);
}

TEST_P(EveryPair, ADepthIsTheLeastOverlap) {
  const auto [one, other] = GetParam();
  int compared = 0;
  const double radius = shapes.shape(one, {}, {1, 0, 0, 0}).radius();
  for_each(-radius - .12, -radius - .01, 60, [&](const auto& a, const auto& b) {
    Closest<double> found{};
    if (closest_of(a, b, 10.0, found) == Encounter::near) return;
    ++compared;
    const double depth = a.radius() + b.radius() - found.distance;
    const bool is_round = one < kBox || other == kCylinder;
    const double within = is_round ? 1e-7 : 1e-12;
    const HullPoints<double> points = convex_points(a, b, 0.0, kExtent);
    EXPECT_NEAR(one == kSphere ? overlap_along(a, b, points.at[0].normal) : depth, depth, 1e-6);
    EXPECT_NEAR(overlap_along(a, b, found.normal), depth, within);
    EXPECT_NEAR(length(subtract(found.a, found.b)), -found.distance, 1e-9);
    if (!is_round) {
      EXPECT_NEAR(least_overlap(a, b), depth, within);
    } else {
      std::mt19937_64 random(3);
      for (int k = 0; k < 2000; ++k) {
        const Point far = random_direction(random), n = add_scaled(found.normal, k % 2 == 0 ? 1 : 1e-3, far);
        EXPECT_GT(overlap_along(a, b, scaled(1 / length(n), n)), depth - within);
      }
    }
  });
  EXPECT_GT(compared, one == kSphere ? 0 : 8);
}

TEST_P(EveryPair, SinglePrecisionHasItsDigits) {
  const Shapes<float> narrow;
  const auto same = [&](const ConvexShape<double>& shape, std::size_t which) {
    const auto one = [](const Point& p) {
      return Vector3<float>{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
    };
    const Axes3<float> axes{one(shape.axes.x), one(shape.axes.y), one(shape.axes.z)};
    return ConvexShape<float>{narrow.model, narrow.geoms[which], one(shape.centre), axes};
  };
  std::vector<double> errors;
  for_each(-.3, .1, 1500, [&](const auto& a, const auto& b) {
    Closest<double> exact{};
    Closest<float> found{};
    const Encounter encounter = closest_of(a, b, 10.0, exact);
    if (closest_of(same(a, GetParam().first), same(b, GetParam().second), 10.0F, found) != encounter) {
      EXPECT_LT(std::abs(exact.distance), 1e-4);  // that has no direction in single precision
    } else {
      errors.push_back(std::abs(static_cast<double>(found.distance) - exact.distance));
    }
  });
  std::sort(errors.begin(), errors.end());
  const bool is_round = GetParam().first == kCylinder || GetParam().second == kCylinder;
  EXPECT_LT(errors[errors.size() * 49 / 50], is_round ? 2e-5 : 2e-6);
  EXPECT_LT(errors.back(), is_round ? 2e-3 : 1e-5);
}

TEST_P(EveryPair, PointsLieHalfwayBetweenTheSurfacesAlongAUnitNormal) {
  for_each(-.02, .02, 200, [&](const auto& a, const auto& b) {
    const HullPoints<double> found = convex_points(a, b, .02, kExtent);
    EXPECT_LE(found.count, 4);
    for (Index k = 0; k < found.count; ++k) {
      const auto& point = found.at[k];
      EXPECT_NEAR(length(point.normal), 1, 1e-12);
      EXPECT_GE(point.depth, -.02);
      // One is on its shape. The other is on the face's plane, up to five degrees off.
      const double off_a = outside(a, add_scaled(point.point, .5 * point.depth, point.normal));
      const double off_b = outside(b, add_scaled(point.point, -.5 * point.depth, point.normal));
      EXPECT_LT(std::min(off_a, off_b), 1e-9);
      EXPECT_LT(std::max(off_a, off_b), .02);
    }
  });
}

TEST_P(EveryPair, DegenerateStatesEnd) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Quaternion<double> turns[] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {std::sqrt(.5), 0, std::sqrt(.5), 0}};
  const auto check = [&](const auto& all, auto real) {
    using T = decltype(real);
    for (const auto& turn : turns)
      for (const double x : {0.0, 1e-30, 1e-9, .15, .3})
        for (const double z : {0.0, 1e-12, .1, .25, .22, -.27}) {
          const auto a = all.shape(GetParam().first, {0, 0, 0}, {1, 0, 0, 0});
          const auto b = all.shape(GetParam().second, {T(x), 0, T(z)}, {T(turn.w), T(turn.x), T(turn.y), T(turn.z)});
          const auto found = convex_points(a, b, T(.01), T(kExtent));
          for (Index k = 0; k < found.count; ++k) {
            EXPECT_TRUE(std::isfinite(found.at[k].depth)) << x << " " << z;
            EXPECT_NEAR(dot(found.at[k].normal, found.at[k].normal), 1, 1e-5) << x << " " << z;
            EXPECT_TRUE(std::isfinite(dot(found.at[k].point, found.at[k].point))) << x << " " << z;
          }
        }
    const auto a = all.shape(GetParam().first, {0, 0, 0}, {1, 0, 0, 0});
    for (const T w : {T(0), static_cast<T>(nan)}) {
      const auto b = all.shape(GetParam().second, {static_cast<T>(nan), 0, 0}, {w, 1, 0, 0});
      EXPECT_EQ(convex_points(a, b, T(.01), T(kExtent)).count, 0);
    }
  };
  check(shapes, 0.0);
  check(Shapes<float>(), 0.0F);
}

/// Points of a shape a hundredth deep in a box's upper face, off its middle, in the kinds' order.
HullPoints<double> on_a_box(std::size_t which, double half_height, const Quaternion<double>& turn) {
  const Shapes<double> shapes;
  const auto box = shapes.shape(kBox, {.02, .01, 0}, {1, 0, 0, 0});
  const auto on = shapes.shape(which, {0, 0, .15 + half_height - .01}, turn);
  HullPoints<double> found = which > kBox ? convex_points(box, on, 0.0, kExtent) : convex_points(on, box, 0.0, kExtent);
  for (Index k = 0; k < found.count; ++k) {
    EXPECT_NEAR(found.at[k].depth, .01, 1e-12);
    EXPECT_NEAR(found.at[k].normal.z, which > kBox ? 1 : -1, 1e-12);
    EXPECT_NEAR(found.at[k].point.z, .145, 1e-12);
    EXPECT_LT(std::abs(found.at[k].point.x - .02), .2 + 1e-12);
    EXPECT_LT(std::abs(found.at[k].point.y - .01), .1 + 1e-12);
  }
  return found;
}
double distance_of(const HullPoints<double>& found, Index i, Index j) {
  return length(subtract(found.at[i].point, found.at[j].point));
}

TEST(ConvexFaces, AFaceOnAFaceHasFourPointsThatSpanBoth) {
  for (const std::size_t which : {kCylinder, kPrism}) {
    const HullPoints<double> found = on_a_box(which, which == kCylinder ? .12 : .1, {1, 0, 0, 0});
    ASSERT_EQ(found.count, 4);
    const Point one = subtract(found.at[2].point, found.at[0].point),
                other = subtract(found.at[3].point, found.at[1].point);
    EXPECT_GT(length(cross(one, other)) / 2, .035) << "of .08, the box's face";
  }
}

TEST(ConvexFaces, ALineOnAFaceEndsWithEither) {
  const double half = std::sqrt(.5);
  const HullPoints<double> cylinder = on_a_box(kCylinder, .15, {half, 0, half, 0});  // its axis along x
  ASSERT_EQ(cylinder.count, 2);
  EXPECT_NEAR(distance_of(cylinder, 0, 1), .24, 1e-12) << "the cylinder's length";
  const HullPoints<double> capsule = on_a_box(kCapsule, .08, {half, half, 0, 0});  // along y
  ASSERT_EQ(capsule.count, 2);
  EXPECT_NEAR(distance_of(capsule, 0, 1), .2, 1e-12) << "the box's width";
  EXPECT_EQ(on_a_box(kSphere, .1, {1, 0, 0, 0}).count, 1);
}

std::vector<std::pair<std::size_t, std::size_t>> all_pairs() {
  std::vector<std::pair<std::size_t, std::size_t>> found;
  for (std::size_t a = 0; a < kShapes; ++a)
    for (std::size_t b = std::max(a, kCylinder); b < kShapes; ++b)
      if (a >= kPrism || b != kBox || a == kCylinder) found.emplace_back(a, b);
  return found;
}
std::string name_of(const testing::TestParamInfo<std::pair<std::size_t, std::size_t>>& tested) {
  const char* const kinds[] = {"Sphere", "Capsule", "Cylinder", "Box", "Prism", "Tetrahedron"};
  return std::string(kinds[tested.param.first]) + kinds[tested.param.second];
}
INSTANTIATE_TEST_SUITE_P(ConvexPoints, EveryPair, testing::ValuesIn(all_pairs()), name_of);

}  // namespace

}  // namespace stiction::test
