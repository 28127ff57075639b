#pragma once

#include "core/algorithm/articulated/boxes/touch_lanes.hpp"
#include "core/algorithm/articulated/convex/touch_convex.hpp"
#include "core/algorithm/articulated/fields/touch_field.hpp"
#include "core/algorithm/articulated/touch_hull.hpp"
#include "core/algorithm/articulated/workspace.hpp"
#include "core/algorithm/collision/plane_contacts.hpp"
#include "core/algorithm/collision/round_contacts.hpp"

/// Points at which the shapes of robots touch. A pair has fixed places for its points, which lanes use or not: what a
/// lane finds does not depend on others. MuJoCo chooses the points (MuJoCo documentation, "Collision detection"). A box
/// on a plane has the first four corners below its centre. Two capsules have one, or two where they are parallel.
namespace stiction::inline STICTION_ISA {

/// Writes down a point where a lane has it and it is nearer than the pair's margin.
template <class Real, int kStride, class T>
STICTION_HD void put_point(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair, Index at,
                           Mask<Real> has, const ContactCandidate<Real>& found) {
  auto& work = robots.work;
  work.distance[at] = -found.depth;
  work.touches[at] = and_(has, work.distance[at] < Real(pair.margin));
  work.is_point[at] = any(work.touches[at]) ? 1 : 0;
  work.point.put(at, found.point);
  work.normal.put(at, found.normal);
}

/// Lanes in which two shapes are near enough to touch.
template <class Real, int kStride, class T>
STICTION_HD Mask<Real> are_near(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  const auto& place = robots.work.geom_position;
  const Vector3<Real> apart = subtract(place[pair.geom_a], place[pair.geom_b]);
  return dot(apart, apart) < Real(pair.bound * pair.bound);
}

/// The first four corners below the centre, of those within reach.
template <class Real, int kStride, class T>
STICTION_HD void touch_corners(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair,
                               const T (&size)[3], Real height, const Vector3<Real>& normal) {
  const auto& work = robots.work;
  Real taken(0);
  for (Index k = 0; k < 8; ++k) {
    const Vector3<Real> corner = along(work.geom_axes[pair.geom_b], corner_of<Real>(size, k));
    const Real below = dot(normal, corner);
    const Real distance = height + below;
    const auto counts = and_(and_(distance <= Real(pair.reach), below <= Real(0)), taken < Real(4));
    taken = select(counts, taken + Real(1), taken);
    const Vector3<Real> point = added(work.geom_position[pair.geom_b], corner);
    put_point(robots, pair, pair.first + k, counts, on_plane(normal, point, distance, -distance, k));
  }
}

/// The rim of a cylinder: its lowest point, and the one above that at the other end. Two more of the lower end are a
/// third of a turn to either side. A cylinder that stands has the first on its x axis.
template <class Real, int kStride, class T>
STICTION_HD void touch_rim(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair, const T (&size)[3],
                           Real height, const Vector3<Real>& normal) {
  constexpr auto kHalfRootOf3 = static_cast<T>(0.86602540378443864676);
  const auto& work = robots.work;
  const Axes3<Real>& axes = work.geom_axes[pair.geom_b];
  const Vector3<Real>& centre = work.geom_position[pair.geom_b];
  const Real lean = dot(normal, axes.z), side = select(lean > Real(0), Real(-1), Real(1));
  const Vector3<Real> down = scaled(side * Real(size[1]), axes.z);
  const Vector3<Real> slope = subtract(scaled(lean, axes.z), normal);
  const Vector3<Real> lowest = scaled(Real(size[0]), direction_of(slope, axes.x, Real(T(kLeastValue))));
  const Vector3<Real> across = cross(lowest, axes.z);
  const Vector3<Real> wide = scaled(Real(kHalfRootOf3), across);
  const Vector3<Real> back = scaled(Real(T(-0.5)), lowest);
  const Vector3<Real> places[] = {added(lowest, down), subtract(lowest, down), added(added(back, wide), down),
                                  added(subtract(back, wide), down)};
  for (Index k = 0; k < 4; ++k) {
    const Real own_height = height + dot(normal, places[k]);
    put_point(robots, pair, pair.first + k, Real(0) == Real(0),
              on_plane(normal, added(centre, places[k]), own_height, -own_height, k));
  }
}

/// A plane and something round, or a box.
template <class Real, int kStride, class T>
STICTION_HD void touch_ground(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  auto& work = robots.work;
  const auto& geom = robots.model.geom[pair.geom_b];
  const Vector3<Real> normal = in_lanes<Real>(pair.normal);
  const Vector3<Real>& centre = work.geom_position[pair.geom_b];
  const Real height = dot(normal, centre) - Real(pair.offset);
  for (Index k = 0; k < pair.points; ++k) work.is_point[pair.first + k] = 0;
  if (!any(height < Real(pair.bound))) return;
  if (geom.kind == GeomKind::box) return touch_corners(robots, pair, geom.size, height, normal);
  if (geom.kind == GeomKind::cylinder) return touch_rim(robots, pair, geom.size, height, normal);
  if (geom.kind == GeomKind::mesh) return touch_hull(robots, pair, height, normal);
  const Real radius(geom.size[0]);
  const auto add = [&](Index at, Real own_height, const Vector3<Real>& point) {
    put_point(robots, pair, at, Real(0) == Real(0), on_plane(normal, point, own_height, radius - own_height, at));
  };
  if (geom.kind == GeomKind::sphere) return add(pair.first, height, centre);
  const Vector3<Real> half = scaled(Real(geom.size[1]), work.geom_axes[pair.geom_b].z);
  const Real rise = dot(normal, half);
  add(pair.first, height + rise, added(centre, half));
  add(pair.first + 1, height - rise, subtract(centre, half));
}

/// The k-th end of a segment that lies along another, and the other's nearest point: where that is an end, the nearest
/// point to it.
template <class Real>
STICTION_HD NearestPair<Real> beside_end(const Segment<Real>& one, const Segment<Real>& other, Index k) {
  const Real end(static_cast<Scalar<Real>>(2 * k - 1));
  const Real t = nearest_on(other, point_at(one, end));
  const Real s = select(abs_(t) >= Real(1), nearest_on(one, point_at(other, t)), end);
  return {s, t, Real(0) == Real(0)};
}

/// Two round shapes: segments with a radius. If their middle lines cross, the normal is across both. Parallel capsules
/// touch at both ends of where they lie along each other.
template <class Real, int kStride, class T>
STICTION_HD void touch_round(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  constexpr T kAlongSame = T(1e-8);  // of the square of a sine
  const Real least{T(kLeastValue)};
  auto& work = robots.work;
  const auto segment = [&](Index g) {
    const auto& geom = robots.model.geom[g];
    const T half = geom.kind == GeomKind::capsule ? geom.size[1] : T(0);
    return Segment<Real>{work.geom_position[g], scaled(Real(half), work.geom_axes[g].z)};
  };
  for (Index k = 0; k < pair.points; ++k) work.is_point[pair.first + k] = 0;
  if (!any(are_near(robots, pair))) return;
  const Segment<Real> one = segment(pair.geom_a), other = segment(pair.geom_b);
  const auto nearest = nearest_points(one, other, sizeof(T) == sizeof(double) ? T(kLeastValue) : T(1e-9));
  const Vector3<Real> across = cross(work.geom_axes[pair.geom_a].z, work.geom_axes[pair.geom_b].z);
  const Vector3<Real> otherwise = direction_of(across, Vector3<Real>{Real(1), Real(0), Real(0)}, least);
  const Real radius_a(robots.model.geom[pair.geom_a].size[0]), radius_b(robots.model.geom[pair.geom_b].size[0]);
  const auto put = [&](Index k, Mask<Real> has, Real s, Real t) {
    put_point(robots, pair, pair.first + k, has,
              between_points(point_at(one, s), radius_a, point_at(other, t), radius_b, otherwise, k, least));
  };
  const auto are_parallel = dot(across, across) < Real(kAlongSame);
  if (pair.points == 1 || !any(are_parallel)) return put(0, Real(0) == Real(0), nearest.s, nearest.t);
  const auto lower = beside_end(one, other, 0), upper = beside_end(one, other, 1);
  put(0, Real(0) == Real(0), select(are_parallel, lower.s, nearest.s), select(are_parallel, lower.t, nearest.t));
  put(1, are_parallel, upper.s, upper.t);
}

/// Lanes in which no axis of a box parts it from something round by the margin.
template <class Real, int kStride, class T>
STICTION_HD Mask<Real> are_near_faces(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  constexpr T kMore = T(1.0001);  // than rounding
  const auto &round = robots.model.geom[pair.geom_a], &box = robots.model.geom[pair.geom_b];
  const Axes3<Real>& axes = robots.work.geom_axes[pair.geom_b];
  const Vector3<Real> apart = subtract(robots.work.geom_position[pair.geom_a], robots.work.geom_position[pair.geom_b]);
  const T half = round.kind == GeomKind::capsule ? round.size[1] : T(0);
  auto near = Real(0) == Real(0);
  for (Index k = 0; k < 3; ++k) {
    const Vector3<Real> own = axis(axes, k);
    const Real reach = fma_(Real(half), abs_(dot(own, robots.work.geom_axes[pair.geom_a].z)),
                            Real(round.size[0] + box.size[k] + pair.margin));
    near = and_(near, abs_(dot(own, apart)) < Real(kMore) * reach);
  }
  return near;
}

/// A box and all but a plane.
template <class Real, int kStride, class T>
STICTION_HD void touch_box(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  for (Index k = 0; k < pair.points; ++k) robots.work.is_point[pair.first + k] = 0;
  auto near = are_near(robots, pair);
  if (!has_three_axes(robots.model.geom[pair.geom_a].kind) && any(near))
    near = and_(near, are_near_faces(robots, pair));
  if (any(near)) touch_box_by_lane(robots, pair, near);
}

/// A hull or a cylinder, and all but a plane or a height field.
template <class Real, int kStride, class T>
STICTION_HD void touch_convex(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  for (Index k = 0; k < pair.points; ++k) robots.work.is_point[pair.first + k] = 0;
  const auto near = are_near(robots, pair);
  if (any(near)) touch_convex_by_lane(robots, pair, near);
}

/// A height field and something round, or a box. Returns a bit for each lane that had more points than places.
template <class Real, int kStride, class T>
STICTION_HD unsigned touch_field(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair) {
  const auto& work = robots.work;
  for (Index k = 0; k < pair.points; ++k) work.is_point[pair.first + k] = 0;
  const Vector3<Real> apart = subtract(work.geom_position[pair.geom_b], work.geom_position[pair.geom_a]);
  const auto near = dot(work.geom_axes[pair.geom_a].z, apart) < Real(pair.bound);
  return any(near) ? touch_field_by_lane(robots, pair, near) : 0U;
}

/// Finds the points of all pairs. Returns a bit for each lane in which one had more points than places.
template <class Real, int kStride>
STICTION_HD_OUTLINE unsigned find_points(const Robots<Real, kStride>& robots) {
  const auto& model = robots.model;
  unsigned full = 0;
  for (Index p = 0; p < model.pairs; ++p) {
    const auto& pair = model.pair[p];
    if (model.geom[pair.geom_a].kind == GeomKind::plane) {
      touch_ground(robots, pair);
    } else if (model.geom[pair.geom_a].kind == GeomKind::height_field) {
      full |= touch_field(robots, pair);
    } else if (is_general(model.geom[pair.geom_a].kind) || is_general(model.geom[pair.geom_b].kind)) {
      touch_convex(robots, pair);
    } else if (model.geom[pair.geom_b].kind == GeomKind::box) {
      touch_box(robots, pair);
    } else {
      touch_round(robots, pair);
    }
  }
  return full;
}

/// Limits that are near enough to have a row.
template <class Real, int kStride>
STICTION_HD void find_limits(const Robots<Real, kStride>& robots) {
  auto& work = robots.work;
  for (Index i = 0; i < robots.model.limits; ++i) {
    const auto& limit = robots.model.limit[i];
    const Real distance = (work.qpos[limit.q] - Real(limit.bound)) * Real(limit.sign);
    work.limited[i] = distance < Real(limit.margin);
    work.is_limit[i] = any(work.limited[i]) ? 1 : 0;
  }
}

}  // namespace stiction::inline STICTION_ISA
