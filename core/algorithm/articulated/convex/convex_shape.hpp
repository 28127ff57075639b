#pragma once

#include "core/algorithm/articulated/spatial.hpp"
#include "core/algorithm/collision/plane_contacts.hpp"
#include "core/job/articulated_job.hpp"

/// Convex shapes by their support: the point that lies farthest along a direction.
namespace stiction::inline STICTION_ISA {

/// A shape in one lane. A sphere is its centre here, and a capsule its middle line: their radius comes on top.
template <class T>
struct ConvexShape {
  const ArticulatedModelView<T>& model;
  const ArticulatedGeomData<T>& geom;
  Vector3<T> centre;
  Axes3<T> axes;

  [[nodiscard]] STICTION_HD bool is(GeomKind kind) const { return geom.kind == kind; }
  [[nodiscard]] STICTION_HD T radius() const {
    return is(GeomKind::sphere) || is(GeomKind::capsule) ? geom.size[0] : T(0);
  }
  /// A point of its own frame in the world.
  [[nodiscard]] STICTION_HD Vector3<T> placed(const Vector3<T>& own) const { return added(centre, along(axes, own)); }
  [[nodiscard]] STICTION_HD Vector3<T> vertex(Index v) const { return in_lanes<T>(model.vertex[v].place); }
};

/// A point of a shape's surface. Its number says which corner of a box, vertex of a hull, end of a capsule, or cap of a
/// cylinder it is.
template <class T>
struct SupportPoint {
  Vector3<T> place;
  Index number;
};

/// The vertex of a hull that is farthest along a direction in its frame, from vertex `at` on along edges. Each is
/// farther than the one before.
template <class T>
STICTION_HD Index farthest_vertex(const ConvexShape<T>& hull, const Vector3<T>& way, Index at) {
  const auto& model = hull.model;
  T most = dot(way, hull.vertex(at));
  for (bool goes_on = true; goes_on;) {
    goes_on = false;
    const auto from = model.vertex[at];
    for (Index f = from.face_begin; f < from.face_end; ++f) {
      const auto& face = model.face[f];
      const Index next = model.corner[face.place + 1 == face.end ? face.begin : face.place + 1];
      const T far = dot(way, hull.vertex(next));
      if (!(far > most)) continue;
      most = far;
      at = next;
      goes_on = true;
    }
  }
  return at;
}

/// `from`: a vertex of a hull to look on from.
template <class T>
STICTION_HD_OUTLINE SupportPoint<T> support_of(const ConvexShape<T>& shape, const Vector3<T>& way, Index from) {
  constexpr T kAcross = sizeof(T) == sizeof(double) ? T(1e-30) : T(1e-24);  // of the square of a length
  const auto& size = shape.geom.size;
  if (shape.is(GeomKind::sphere)) return {shape.centre, 0};
  const T rise = dot(shape.axes.z, way);
  const bool is_up = rise >= T(0);
  if (shape.is(GeomKind::capsule))
    return {add_scaled(shape.centre, is_up ? size[1] : -size[1], shape.axes.z), is_up ? 0 : 1};
  const Vector3<T> own{dot(shape.axes.x, way), dot(shape.axes.y, way), rise};
  if (shape.is(GeomKind::cylinder)) {
    const T square = fma_(own.x, own.x, own.y * own.y);
    const T scale = square > kAcross * dot(own, own) ? div_(size[0], sqrt_(square)) : T(0);
    return {shape.placed({scale * own.x, scale * own.y, is_up ? size[1] : -size[1]}), is_up ? 0 : 1};
  }
  if (shape.is(GeomKind::box)) {
    const Index corner = (own.x >= T(0) ? 1 : 0) + (own.y >= T(0) ? 2 : 0) + (is_up ? 4 : 0);
    return {shape.placed(corner_of<T>(size, corner)), corner};
  }
  const Index vertex = farthest_vertex(shape, own, from);
  return {shape.placed(shape.vertex(vertex)), vertex};
}

/// A point of the difference of two shapes, a - b.
template <class T>
struct DifferencePoint {
  Vector3<T> a, b;
  Index number_a, number_b;

  [[nodiscard]] STICTION_HD Vector3<T> place() const { return subtract(a, b); }
  [[nodiscard]] STICTION_HD bool is_at(const Vector3<T>& other) const {
    const Vector3<T> own = place();
    return own.x == other.x && own.y == other.y && own.z == other.z;
  }
};

/// Returns true if one of the points is the other.
template <class T>
STICTION_HD bool has_point(const DifferencePoint<T>* points, Index count, const DifferencePoint<T>& other) {
  const Vector3<T> place = other.place();
  bool found = false;
  for (Index k = 0; k < count; ++k) found = found || points[k].is_at(place);
  return found;
}

/// Two shapes, with the numbers of the hulls' vertices that were found last.
template <class T>
struct ConvexPair {
  const ConvexShape<T>&a, &b;
  T extent;  ///< of both and of what is between: roundings are measured by it
  Index last_a = a.geom.hull_begin, last_b = b.geom.hull_begin;

  /// The point of the difference that is farthest along a direction.
  [[nodiscard]] STICTION_HD DifferencePoint<T> support(const Vector3<T>& way) {
    const SupportPoint<T> one = support_of(a, way, last_a), other = support_of(b, scaled(T(-1), way), last_b);
    last_a = a.is(GeomKind::mesh) ? one.number : last_a;
    last_b = b.is(GeomKind::mesh) ? other.number : last_b;
    return {one.place, other.place, one.number, other.number};
  }
};

/// Up to four points of a difference, and weights of them: a point between.
template <class T>
struct Simplex {
  DifferencePoint<T> at[4];
  T weight[4];
  Index count = 0;

  /// The points of both shapes between those of the corners.
  STICTION_HD void mix(Vector3<T>& a, Vector3<T>& b) const {
    a = scaled(weight[0], at[0].a);
    b = scaled(weight[0], at[0].b);
    for (Index k = 1; k < count; ++k) {
      a = add_scaled(a, weight[k], at[k].a);
      b = add_scaled(b, weight[k], at[k].b);
    }
  }
};

/// Nearest points of two shapes, or those of the shortest way out of each other.
template <class T>
struct Closest {
  Vector3<T> normal;  ///< unit, from the first to the second
  Vector3<T> a, b;    ///< points of both, of a middle line where there is one
  T distance;         ///< of these along the normal, negative: a depth
  Simplex<T> between;
};

}  // namespace stiction::inline STICTION_ISA
