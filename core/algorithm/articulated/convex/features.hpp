#pragma once

#include "core/algorithm/articulated/convex/convex_shape.hpp"

/// Faces and edges of convex shapes that lie around points of their surface.
namespace stiction::inline STICTION_ISA {

/// A flat face: of a box, one of six; of a cylinder, a cap; of a hull, an entry of a vertex in its faces.
template <class T>
struct ShapeFace {
  Vector3<T> normal;  ///< outward
  Index number, corners;
};

/// Corner k of a face; a cap stands for sixteen. The order is MuJoCo's.
template <class T>
STICTION_HD_OUTLINE Vector3<T> corner_of_face(const ConvexShape<T>& shape, const ShapeFace<T>& face, Index k) {
  if (shape.is(GeomKind::mesh)) {
    const auto& own = shape.model.face[face.number];
    return shape.placed(shape.vertex(shape.model.corner[own.end - 1 - k]));
  }
  const auto& size = shape.geom.size;
  if (shape.is(GeomKind::box)) {
    constexpr std::uint32_t kCorners[] = {0x5137, 0x0462, 0x6732, 0x0154, 0x4576, 0x1023};
    return shape.placed(corner_of<T>(size, static_cast<Index>(kCorners[face.number] >> 4 * k & 15U)));
  }
  constexpr double kCosines[] = {1, 0.92387953251128674, 0.70710678118654752, 0.38268343236508977, 0};
  const auto cosine = [&](Index turn) {
    const Index half = turn % 16 < 8 ? turn % 16 : 16 - turn % 16;
    return T(half <= 4 ? kCosines[half] : -kCosines[8 - half]);
  };
  const T side(face.number == 0 ? 1 : -1);
  return shape.placed({cosine(k) * size[0], -side * (cosine(k + 12) * size[0]), side * size[1]});
}

/// Up to three points of a shape that are not the same.
template <class T>
struct Feature {
  SupportPoint<T> at[3];
  Index count = 0;

  STICTION_HD void add(const Vector3<T>& place, Index number) {
    for (Index k = 0; k < count; ++k)
      if (at[k].number == number) return;
    at[count++] = {place, number};
  }
};

/// Calls f with every face that all of a feature's points are in, until it returns true. Returns what it returns last.
template <class T, class F>
STICTION_HD bool any_face(const ConvexShape<T>& shape, const Feature<T>& feature, F&& f) {
  const Index first = feature.at[0].number;
  if (shape.is(GeomKind::cylinder)) {
    if (feature.count > 1) return false;
    return f(ShapeFace<T>{scaled(T(first == 0 ? 1 : -1), shape.axes.z), first, 16});
  }
  if (shape.is(GeomKind::box)) {
    for (Index k = 0; k < 3; ++k) {
      const Index side = first >> k & 1;
      bool is_in = true;
      for (Index j = 1; j < feature.count; ++j) is_in = is_in && (feature.at[j].number >> k & 1) == side;
      const Vector3<T> normal = scaled(T(side == 1 ? 1 : -1), axis(shape.axes, k));
      if (is_in && f(ShapeFace<T>{normal, 2 * k + 1 - side, 4})) return true;
    }
  }
  if (!shape.is(GeomKind::mesh)) return false;
  const auto& model = shape.model;
  const auto has = [&](Index v, Index begin) {
    for (Index face = model.vertex[v].face_begin; face < model.vertex[v].face_end; ++face)
      if (model.face[face].begin == begin) return true;
    return false;
  };
  for (Index face = model.vertex[first].face_begin; face < model.vertex[first].face_end; ++face) {
    const auto& own = model.face[face];
    bool is_in = true;
    for (Index j = 1; j < feature.count; ++j) is_in = is_in && has(feature.at[j].number, own.begin);
    if (is_in && f(ShapeFace<T>{along(shape.axes, in_lanes<T>(own.normal)), face, own.end - own.begin})) return true;
  }
  return false;
}

/// An edge from one point to another, or a line on a round side.
template <class T>
struct ShapeEdge {
  Vector3<T> from, to;
};

/// Calls f with every edge of a shape that its feature, of one or two points, lies in. One of a round side is farthest
/// along `way`, and of a capsule `beyond` its side.
template <class T, class F>
STICTION_HD bool any_edge(const ConvexShape<T>& shape, const Feature<T>& feature, const Vector3<T>& way, T beyond,
                          F&& f) {
  const auto& [place, number] = feature.at[0];
  const auto& size = shape.geom.size;
  if (shape.is(GeomKind::capsule) || shape.is(GeomKind::cylinder)) {
    const Vector3<T> across = add_scaled(way, -dot(way, shape.axes.z), shape.axes.z);
    const T radius = shape.is(GeomKind::capsule) ? size[0] + beyond : size[0];
    const Vector3<T> side = add_scaled(shape.centre, radius, direction_of(across, Vector3<T>{}, T(0)));
    const T half = number == 0 ? size[1] : -size[1];
    return f(ShapeEdge<T>{add_scaled(side, half, shape.axes.z), add_scaled(side, -half, shape.axes.z)});
  }
  if (feature.count == 2) return f(ShapeEdge<T>{place, feature.at[1].place});
  if (shape.is(GeomKind::box)) {
    for (Index k = 0; k < 3; ++k)
      if (f(ShapeEdge<T>{place, shape.placed(corner_of<T>(size, number ^ 1 << k))})) return true;
    return false;
  }
  const auto& vertex = shape.model.vertex[number];
  for (Index face = vertex.face_begin; face < vertex.face_end; ++face) {
    const auto& own = shape.model.face[face];
    const Index before = shape.model.corner[own.place == own.begin ? own.end - 1 : own.place - 1];
    if (f(ShapeEdge<T>{place, shape.placed(shape.vertex(before))})) return true;
  }
  return false;
}

}  // namespace stiction::inline STICTION_ISA
