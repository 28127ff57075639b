#pragma once

#include "core/algorithm/collision/round_contacts.hpp"

/// A box against a sphere or a capsule, in the box's axes.
namespace stiction::inline STICTION_ISA {

/// Cosine above which a direction counts as a face's normal: a capsule that lies on a face touches it in two points.
inline constexpr double kFaceCosine = 0.9998;

/// A segment and a box's half extents, in the box's axes.
template <class T>
struct SegmentInBox {
  T c[3], h[3], e[3];

  STICTION_HD T at(Index k, T t) const { return fma_(t, h[k], c[k]); }
  /// Returns the distance of the point at t beyond the faces of axis k, signed.
  STICTION_HD T beyond(Index k, T t) const {
    const T x = at(k, t);
    return x - clamp_(x, -e[k], e[k]);
  }
  /// Half the derivative, with respect to t, of the squared distance of the box and the point at t.
  STICTION_HD T slope(T t) const { return fma_(h[2], beyond(2, t), fma_(h[1], beyond(1, t), h[0] * beyond(0, t))); }
};

/// Returns the parameter of a segment's point nearest to the box. The squared distance is convex and its slope
/// piecewise linear, with kinks where the segment passes a face's plane. The zero lies between two neighbouring kinks,
/// or the slope is zero on a stretch, whose middle is returned.
template <class T>
STICTION_HD_OUTLINE T nearest_to_box(const SegmentInBox<T>& s) {
  T low(-1), high(1), flat_low(2), flat_high(-2);
  T slope_low = s.slope(low);
  T slope_high = s.slope(high);
  const auto look_at = [&](T t) {
    const T slope = s.slope(t);
    if (slope < T(0) && t >= low) {
      low = t;
      slope_low = slope;
    }
    if (slope > T(0) && t <= high) {
      high = t;
      slope_high = slope;
    }
    if (slope == T(0)) {
      flat_low = min_(t, flat_low);
      flat_high = max_(t, flat_high);
    }
  };
  look_at(T(-1));
  look_at(T(1));
  for (Index k = 0; k < 3; ++k) {
    if (s.h[k] == T(0)) continue;
    look_at(clamp_(div_(s.e[k] - s.c[k], s.h[k]), T(-1), T(1)));
    look_at(clamp_(div_(-s.e[k] - s.c[k], s.h[k]), T(-1), T(1)));
  }
  if (flat_low <= flat_high) return T(0.5) * (flat_low + flat_high);
  if (slope_low > T(0)) return T(-1);
  if (slope_high < T(0)) return T(1);
  return clamp_(fma_(high - low, div_(-slope_low, slope_high - slope_low), low), low, high);
}

/// The axis along which a segment that meets the box leaves it soonest: a face's normal, or across the segment and an
/// edge. The first wins a tie.
template <class T>
struct WayOut {
  Vector3<T> normal;
  T overlap;
  Index face;  ///< -1: across an edge
  Index edge;  ///< axis of that edge
};

template <class T>
STICTION_HD_OUTLINE WayOut<T> way_out(const SegmentInBox<T>& s) {
  WayOut<T> best{{T(0), T(0), T(1)}, T(0), -1, -1};
  for (Index k = 0; k < 3; ++k) {
    const T overlap = (s.e[k] + abs_(s.h[k])) - abs_(s.c[k]);
    if (best.face >= 0 && !(overlap < best.overlap)) continue;
    const T sign = sign_of(s.c[k]);
    best = {{k == 0 ? sign : T(0), k == 1 ? sign : T(0), k == 2 ? sign : T(0)}, overlap, k, -1};
  }
  const T square = fma_(s.h[2], s.h[2], fma_(s.h[1], s.h[1], s.h[0] * s.h[0]));
  for (Index k = 0; k < 3; ++k) {
    const Index u = (k + 1) % 3;
    const Index v = (k + 2) % 3;
    // Across axis k and h: components (0, -h_v, h_u) along (k, u, v).
    const T norm_square = fma_(s.h[u], s.h[u], s.h[v] * s.h[v]);
    if (!(norm_square > T(kParallel) * square)) continue;
    const T norm = sqrt_(norm_square);
    T n_u = div_(-s.h[v], norm);
    T n_v = div_(s.h[u], norm);
    const T centre = fma_(n_u, s.c[u], n_v * s.c[v]);
    const T overlap = fma_(s.e[u], abs_(n_u), s.e[v] * abs_(n_v)) - abs_(centre);
    if (!(overlap < best.overlap)) continue;
    const T sign = sign_of(centre);
    n_u = sign * n_u;
    n_v = sign * n_v;
    best = {{k == 0 ? T(0) : (u == 0 ? n_u : n_v), k == 1 ? T(0) : (u == 1 ? n_u : n_v),
             k == 2 ? T(0) : (u == 2 ? n_u : n_v)},
            overlap,
            -1,
            k};
  }
  return best;
}

/// Contacts of one box and one round shape, made in the box's axes.
template <class T>
struct BoxRound {
  SegmentInBox<T> s;
  T radius, margin;
  bool is_sphere;
  Manifold<T> found;

  /// A point at height (e_k + x_k - radius) / 2 above face k's middle plane.
  STICTION_HD void add_on_face(Index k, T sign, T t, Index feature) {
    const T height = sign * s.at(k, t);
    const T middle = T(0.5) * (s.e[k] + (height - radius));
    const auto coordinate = [&](Index axis) { return axis == k ? sign * middle : s.at(axis, t); };
    const auto direction = [&](Index axis) { return axis == k ? sign : T(0); };
    found.add({{coordinate(0), coordinate(1), coordinate(2)},
               {direction(0), direction(1), direction(2)},
               radius + (s.e[k] - height),
               feature},
              margin);
  }

  /// The stretch of the segment over face k: its ends are the contacts. False if there is none.
  STICTION_HD bool add_face(Index k, T sign) {
    T low(-1), high(1);
    for (Index j = 0; j < 3; ++j) {
      if (j == k) continue;
      if (s.h[j] == T(0)) {
        if (abs_(s.c[j]) > s.e[j]) return false;
        continue;
      }
      const T t0 = div_(-s.e[j] - s.c[j], s.h[j]);
      const T t1 = div_(s.e[j] - s.c[j], s.h[j]);
      const T enters = min_(t0, t1);
      const T leaves = max_(t0, t1);
      // For numbers these are max_ and min_; from those with the constants that both begin with, nvcc makes
      // instructions that the PTX gate refuses.
      low = select(enters <= low, low, enters);
      high = select(leaves >= high, high, leaves);
    }
    if (!(low <= high)) return false;
    if (is_sphere) {
      add_on_face(k, sign, T(0), 0);
      return true;
    }
    add_on_face(k, sign, low, 0);
    if (low < high) add_on_face(k, sign, high, 1);
    return true;
  }

  STICTION_HD void add_outside(T t, const Vector3<T>& out, T distance) {
    const Vector3<T> n{div_(out.x, distance), div_(out.y, distance), div_(out.z, distance)};
    const T depth = radius - distance;
    const Vector3<T> p{s.at(0, t), s.at(1, t), s.at(2, t)};
    for (Index k = 0; k < 3; ++k)
      if (abs_(entry(n, k)) >= T(kFaceCosine) && add_face(k, sign_of(entry(n, k)))) return;
    found.add({add_scaled(p, -fma_(T(-0.5), depth, radius), n), n, depth, 2}, margin);
  }

  STICTION_HD void add_inside() {
    const WayOut<T> way = way_out(s);
    if (way.face >= 0 && add_face(way.face, entry(way.normal, way.face) < T(0) ? T(-1) : T(1))) return;
    // Across an edge: the points of the segment and of the box's outermost edge along that direction that are nearest.
    const Index k = way.edge >= 0 ? way.edge : (way.face + 1) % 3;
    const auto corner = [&](Index j) { return j == k ? T(0) : sign_of(entry(way.normal, j)) * s.e[j]; };
    const auto length_along = [&](Index j) { return j == k ? s.e[j] : T(0); };
    const Segment<T> edge{{corner(0), corner(1), corner(2)}, {length_along(0), length_along(1), length_along(2)}};
    const Segment<T> line{{s.c[0], s.c[1], s.c[2]}, {s.h[0], s.h[1], s.h[2]}};
    const NearestPair<T> nearest = nearest_points(line, edge);
    const T depth = way.overlap + radius;
    const Vector3<T> p = point_at(line, nearest.s);
    found.add({add_scaled(p, -fma_(T(-0.5), depth, radius), way.normal), way.normal, depth, 2}, margin);
  }
};

/// Normals from the box to the round shape. Features 0 and 1 are the ends of a stretch over a face, 2 is a single
/// point.
template <class T>
STICTION_HD_OUTLINE Manifold<T> box_round(const PlacedShape<T>& box, const PlacedShape<T>& round, T margin) {
  const Vector3<T> c = components(box.axes, subtract(round.centre, box.centre));
  const Vector3<T> h = components(box.axes, half_segment(round));
  BoxRound<T> pair{{{c.x, c.y, c.z}, {h.x, h.y, h.z}, {box.size[0], box.size[1], box.size[2]}},
                   round.size[0],
                   margin,
                   round.kind == ShapeKind::sphere,
                   {}};
  const T t = nearest_to_box(pair.s);
  const Vector3<T> out{pair.s.beyond(0, t), pair.s.beyond(1, t), pair.s.beyond(2, t)};
  const T distance = length(out);
  if (distance > T(0)) {
    if (pair.radius - distance >= -margin) pair.add_outside(t, out, distance);
  } else {
    pair.add_inside();
  }
  for (Index k = 0; k < pair.found.count; ++k) {
    ContactCandidate<T>& point = pair.found.at[k];
    point.point = added(box.centre, along(box.axes, point.point));
    point.normal = along(box.axes, point.normal);
  }
  return pair.found;
}

}  // namespace stiction::inline STICTION_ISA
