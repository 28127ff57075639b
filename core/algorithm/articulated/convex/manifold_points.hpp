#pragma once

#include "core/algorithm/articulated/convex/features.hpp"
#include "core/algorithm/articulated/touch_hull.hpp"
#include "core/algorithm/collision/face_polygon.hpp"

/// Points where two convex shapes lie on each other, as MuJoCo 4.0 chooses them. They are corners of a face, or ends of
/// an edge, cut to the outline of a face.
namespace stiction::inline STICTION_ISA {

template <class T>
using ConvexPolygon = FacePolygon<T, 2 * kMostFaceCorners>;

/// Four corners of a polygon that span much of it: each in turn goes on while their area grows.
struct FourOf {
  Index at[4];
};
template <class T>
STICTION_HD_OUTLINE FourOf spanning_four(const ConvexPolygon<T>& polygon) {
  const Index count = polygon.count;
  const auto next = [&](Index k) { return k + 1 == count ? 0 : k + 1; };
  FourOf now{{0, 1, 2, 3}}, best = now;
  const auto area = [&](const FourOf& four) {
    const auto& corner = polygon.corner;
    const Vector3<T> n =
        cross(subtract(corner[four.at[0]], corner[four.at[2]]), subtract(corner[four.at[1]], corner[four.at[3]]));
    return dot(n, n);
  };
  T most = area(now);
  const auto goes_on = [&](Index k) {
    FourOf other = now;
    other.at[k] = next(other.at[k]);
    const T found = area(other);
    if (!(found > most)) return false;
    most = found;
    now = best = other;
    return true;
  };
  for (; now.at[0] < count; ++now.at[0]) {
    while (goes_on(3)) {
      while (goes_on(2)) {
      }
      while (goes_on(1)) {
      }
    }
    for (Index k = 1; k < 4 && now.at[k] == now.at[k - 1]; ++k) now.at[k] = next(now.at[k]);
  }
  return best;
}

/// How the points of a polygon become those of a contact with a face.
template <class T>
struct FaceContact {
  const ConvexShape<T>& shape;  ///< that has the face
  ShapeFace<T> face;
  Vector3<T> normal;  ///< of the contact
  Vector3<T> off;     ///< the same or its opposite: away from the face
};

/// Cuts a polygon to a face's outline, and adds its points within `reach`: where an edge is cut two, as MuJoCo 4.0 has.
template <class T>
STICTION_HD_OUTLINE void touch_outline(const FaceContact<T>& contact, ConvexPolygon<T>& polygon, T reach,
                                       HullPoints<T>& found) {
  const ShapeFace<T>& face = contact.face;
  const bool is_edge = polygon.count == 2;
  const auto corner = [&](Index k) { return corner_of_face(contact.shape, face, k == face.corners ? 0 : k); };
  const Vector3<T> begin = corner(0);
  Vector3<T> from = begin;
  Index first = 0;
  for (Index k = 0; k < face.corners && polygon.count > 0; ++k) {
    const Vector3<T> to = corner(k + 1), out = cross(face.normal, subtract(to, from));
    const auto beyond = [&](const Vector3<T>& p) { return dot(out, subtract(p, from)); };
    const bool is_first_in = beyond(polygon.corner[first]) <= T(0);
    polygon = cut_beyond(polygon, beyond, 0, first);
    first = is_first_in && polygon.count > 1 ? 1 : 0;
    from = to;
  }
  const auto height = [&](const Vector3<T>& p) { return dot(face.normal, subtract(p, begin)); };
  const T slope = abs_(dot(face.normal, contact.normal));
  ConvexPolygon<T> near;
  for (Index step = 0; step < polygon.count; ++step) {
    const Vector3<T>& p = polygon.corner[(first + step) % polygon.count];
    if (slope * height(p) <= reach) near.add(p, 0);
  }
  FourOf chosen{{0, 1, 2, 3}};
  Index count = near.count;
  if (near.count > 4) {
    chosen = spanning_four(near);
    count = 4;
  } else if (is_edge && near.count > 2) {
    T most(0);
    for (Index i = 0; i < near.count; ++i)
      for (Index j = i + 1; j < near.count; ++j) {
        const Vector3<T> apart = subtract(near.corner[j], near.corner[i]);
        if (!(dot(apart, apart) > most)) continue;
        most = dot(apart, apart);
        chosen = {{i, j, 0, 0}};
      }
    count = 2;
  }
  for (Index k = 0; k < count; ++k) {
    const Vector3<T>& p = near.corner[chosen.at[k]];
    const T above = height(p), gap = slope * above;
    const Vector3<T> on_face = add_scaled(p, -above, face.normal);
    found.at[k] = {add_scaled(on_face, T(0.5) * gap, contact.off), contact.normal, -gap, k};
  }
  found.count = count;
}

/// Adds the points of two faces that face each other. Returns false if there are none.
template <class T>
STICTION_HD_OUTLINE bool touch_faces(const ConvexShape<T>& a, const Feature<T>& of_a, const ConvexShape<T>& b,
                                     const Feature<T>& of_b, T reach, HullPoints<T>& found) {
  auto facing = T(-0.996);  // of a cosine
  ShapeFace<T> one{}, other{};
  any_face(a, of_a, [&](const ShapeFace<T>& face_a) {
    return any_face(b, of_b, [&](const ShapeFace<T>& face_b) {
      const T cosine = dot(face_a.normal, face_b.normal);
      if (!(cosine < facing)) return false;
      facing = cosine;
      one = face_a;
      other = face_b;
      return false;
    });
  });
  if (one.corners == 0) return false;
  ConvexPolygon<T> polygon;
  for (Index k = 0; k < other.corners; ++k) polygon.add(corner_of_face(b, other, k), k);
  const Vector3<T> normal = scaled(T(-1), other.normal);
  touch_outline(FaceContact<T>{a, one, normal, normal}, polygon, reach, found);
  return true;
}

/// Adds the points of an edge of a thin shape that lies in a face of a flat one. Returns false if there are none.
/// `normal`: of the nearest points, from the flat shape on; `side`: 1 if that is the first.
template <class T>
STICTION_HD_OUTLINE bool touch_edge(const ConvexShape<T>& flat, const Feature<T>& of_flat, const ConvexShape<T>& thin,
                                    const Feature<T>& of_thin, const Vector3<T>& normal, T side, T reach,
                                    HullPoints<T>& found) {
  constexpr T kAcross = T(0.0888);  // of a sine, of an edge in a face and of a face in the normal
  // A capsule is rounded by half the reach more, and the face rises by as much.
  const T more = thin.is(GeomKind::capsule) ? max_(T(0.5) * reach, T(0)) : T(0);
  ShapeFace<T> face{};
  ShapeEdge<T> edge{};
  if (of_thin.count == 3) return false;
  const bool has_edge = any_face(flat, of_flat, [&](const ShapeFace<T>& one) {
    if (!(dot(one.normal, normal) > kAcross)) return false;
    return any_edge(thin, of_thin, scaled(T(-1), normal), more, [&](const ShapeEdge<T>& other) {
      const Vector3<T> way = subtract(other.to, other.from);
      if (!(abs_(dot(way, one.normal)) < kAcross * length(way))) return false;
      face = one;
      edge = {add_scaled(other.from, more, one.normal), add_scaled(other.to, more, one.normal)};
      return true;
    });
  });
  if (!has_edge) return false;
  ConvexPolygon<T> polygon;
  polygon.add(edge.from, 0);
  polygon.add(edge.to, 1);
  touch_outline(FaceContact<T>{flat, face, scaled(side, face.normal), face.normal}, polygon, reach, found);
  return true;
}

/// Adds the points of faces, or of an edge in a face, that lie around the nearest points.
template <class T>
STICTION_HD_OUTLINE void touch_over_faces(const ConvexShape<T>& a, const ConvexShape<T>& b, const Closest<T>& closest,
                                          T reach, HullPoints<T>& found) {
  Feature<T> of_a, of_b;
  for (Index k = 0; k < closest.between.count; ++k) {
    of_a.add(closest.between.at[k].a, closest.between.at[k].number_a);
    of_b.add(closest.between.at[k].b, closest.between.at[k].number_b);
  }
  const Vector3<T> back = scaled(T(-1), closest.normal);
  if (touch_faces(a, of_a, b, of_b, reach, found)) return;
  if (touch_edge(b, of_b, a, of_a, back, T(-1), reach, found)) return;
  touch_edge(a, of_a, b, of_b, closest.normal, T(1), reach, found);
}

}  // namespace stiction::inline STICTION_ISA
