#pragma once

#include "core/algorithm/articulated/convex/separation.hpp"

/// Depth of two convex shapes in each other: the expanding polytope (van den Bergen, Proximity queries and penetration
/// depth computation on 3D game objects, 2001).
namespace stiction::inline STICTION_ISA {

/// A polytope in the difference of two shapes. It grows to where the origin is nearest to the difference's surface.
template <class T>
class GrowingPolytope {
 public:
  static constexpr Index kMostPoints = 48, kMostFaces = 2 * kMostPoints, kMostEdges = 64;

  STICTION_HD explicit GrowingPolytope(ConvexPair<T>& pair) : pair_(pair) {}

  /// Begins with a simplex, to which points are added until it has a volume. Returns false if it gets none.
  STICTION_HD bool begin(const Simplex<T>& simplex) {
    for (Index k = 0; k < simplex.count; ++k) take(simplex.at[k]);
    for (Index axis = 0; axis < 3 && points_ < 2; ++axis) look(axis_of(axis));
    if (points_ == 2) {
      const Vector3<T> d = subtract(place(1), place(0));
      for (Index axis = 0; axis < 3 && points_ < 3; ++axis) look(cross(d, axis_of(axis)));
    }
    if (points_ == 3) look(cross(subtract(place(1), place(0)), subtract(place(2), place(0))));
    if (points_ < 4) return false;
    const Vector3<T> n = cross(subtract(place(1), place(0)), subtract(place(2), place(0)));
    middle_ = scaled(T(0.25), added(added(place(0), place(1)), added(place(2), place(3))));
    const bool is_above = dot(n, subtract(place(3), place(0))) > T(0);
    const Index one = is_above ? 2 : 1, two = is_above ? 1 : 2;
    add_face(0, one, two);
    add_face(0, two, 3);
    add_face(two, one, 3);
    add_face(one, 0, 3);
    return true;
  }

  /// Grows where the surface is nearest, until it is that of the difference. Returns false if no face has an area.
  STICTION_HD bool grow() {
    while (true) {
      best_ = face_[0];
      for (Index f = 1; f < faces_; ++f)
        if (face_[f].height < best_.height) best_ = face_[f];
      if (!(best_.height < kNowhere)) return false;
      if (points_ == kMostPoints) return true;
      const DifferencePoint<T> point = pair_.support(best_.normal);
      const T more = dot(best_.normal, point.place()) - best_.height;
      if (!(more > ConvexRounding<T>::kDepth * pair_.extent) || has_point(point_, points_, point)) return true;
      point_[points_++] = point;
      if (!cover(points_ - 1)) return true;
    }
  }

  STICTION_HD void put(Closest<T>& found) const {
    found.normal = best_.normal;
    found.distance = -best_.height;
    found.between.count = 3;
    const Vector3<T> foot = scaled(best_.height, best_.normal);
    Vector3<T> from[3];
    for (Index k = 0; k < 3; ++k) {
      found.between.at[k] = point_[best_.corner[k]];
      from[k] = subtract(found.between.at[k].place(), foot);
    }
    const T area = dot(best_.normal, cross(subtract(from[1], from[0]), subtract(from[2], from[0])));
    for (Index k = 0; k < 2; ++k)
      found.between.weight[k] = div_(dot(best_.normal, cross(from[(k + 1) % 3], from[(k + 2) % 3])), area);
    found.between.weight[2] = T(1) - (found.between.weight[0] + found.between.weight[1]);
    found.between.mix(found.a, found.b);
  }

 private:
  struct Face {
    Vector3<T> normal;
    T height;  ///< of the face over the origin along its normal
    std::uint8_t corner[3];
  };
  /// Height of a face without an area, or turned over by rounding: it is nowhere nearest, and seen from nowhere.
  static constexpr T kNowhere = T(1e30);
  struct Edge {
    std::uint8_t from, to;
  };

  [[nodiscard]] STICTION_HD Vector3<T> place(Index k) const { return point_[k].place(); }
  static STICTION_HD Vector3<T> axis_of(Index k) { return {T(k == 0 ? 1 : 0), T(k == 1 ? 1 : 0), T(k == 2 ? 1 : 0)}; }

  /// Takes a point that is none of the simplex of those before.
  STICTION_HD bool take(const DifferencePoint<T>& point) {
    constexpr T kFlat = ConvexRounding<T>::kIsDouble ? T(1e-10) : T(1e-5);
    const Vector3<T> p = point.place();
    const T least = kFlat * pair_.extent;
    if (points_ >= 1) {
      const Vector3<T> d = subtract(p, place(0));
      T beside = length(d);
      if (points_ >= 2) {
        const Vector3<T> edge = subtract(place(1), place(0));
        Vector3<T> n = cross(edge, d);
        beside = div_(length(n), length(edge));
        if (points_ == 3) {
          n = cross(edge, subtract(place(2), place(0)));
          beside = div_(abs_(dot(n, d)), length(n));
        }
      }
      if (!(beside > least)) return false;
    }
    point_[points_++] = point;
    return true;
  }
  /// Looks along a direction and against it.
  STICTION_HD void look(const Vector3<T>& way) {
    if (take(pair_.support(way))) return;
    take(pair_.support(scaled(T(-1), way)));
  }

  STICTION_HD void add_face(Index i, Index j, Index k) {
    Face& face = face_[faces_++];
    face.corner[0] = static_cast<std::uint8_t>(i);
    face.corner[1] = static_cast<std::uint8_t>(j);
    face.corner[2] = static_cast<std::uint8_t>(k);
    const Vector3<T> at = place(i), n = cross(subtract(place(j), at), subtract(place(k), at));
    const T size = length(n);
    const bool has_area = size > T(0);
    face.normal = scaled(has_area ? div_(T(1), size) : T(0), n);
    const T height = dot(face.normal, at);
    face.height = has_area && dot(face.normal, middle_) < height ? height : kNowhere;
  }

  /// Replaces the faces that a new point sees. Returns false if there is no room.
  STICTION_HD bool cover(Index point) {
    const T rounding = ConvexRounding<T>::kSeen * pair_.extent;
    const Vector3<T> p = place(point);
    Edge rim[kMostEdges];
    Index edges = 0, kept = 0;
    bool has_room = true;
    for (Index f = 0; f < faces_; ++f) {
      const Face face = face_[f];
      if (!(dot(face.normal, p) - face.height > rounding)) {
        face_[kept++] = face;
        continue;
      }
      for (Index k = 0; k < 3; ++k) {
        const Edge edge{face.corner[k], face.corner[(k + 1) % 3]};
        Index twin = 0;
        while (twin < edges && !(rim[twin].from == edge.to && rim[twin].to == edge.from)) ++twin;
        if (twin < edges) {
          for (--edges; twin < edges; ++twin) rim[twin] = rim[twin + 1];
        } else if (edges < kMostEdges) {
          rim[edges++] = edge;
        } else {
          has_room = false;
        }
      }
    }
    faces_ = kept;
    if (!has_room || faces_ + edges > kMostFaces) return false;
    for (Index e = 0; e < edges; ++e) add_face(rim[e].from, rim[e].to, point);
    return faces_ > 0;
  }

  ConvexPair<T>& pair_;
  Vector3<T> middle_{};  ///< a point inside
  DifferencePoint<T> point_[kMostPoints];
  Face face_[kMostFaces];
  Face best_{};
  Index points_ = 0, faces_ = 0;
};

/// Returns false if the difference has no volume.
template <class T>
STICTION_HD_OUTLINE bool penetrate(ConvexPair<T>& pair, Closest<T>& found) {
  GrowingPolytope<T> polytope(pair);
  if (!polytope.begin(found.between) || !polytope.grow()) return false;
  polytope.put(found);
  return true;
}

}  // namespace stiction::inline STICTION_ISA
