#pragma once

#include "core/algorithm/articulated/boxes/sphere_box.hpp"
#include "core/algorithm/articulated/fields/grid.hpp"
#include "core/algorithm/articulated/touch_by_lane.hpp"
#include "core/algorithm/collision/box_axes.hpp"
#include "core/algorithm/collision/plane_contacts.hpp"

/// Points at which spheres, capsules and boxes touch a height field. MuJoCo has a point for each of the field's prisms
/// that is nearer than the margin (MuJoCo documentation, "Collision detection"). Spheres and capsules have these.
/// Ends of capsules over the prism are points as well, as on planes. Boxes touch by corners, the first four below their
/// centre, as on planes, and by ridges and peaks of the field.
namespace stiction::inline STICTION_ISA {

/// The points of a pair in one lane, in the axes of the field. Without room the shallowest one leaves.
template <class T>
struct FieldPoints {
  ContactCandidate<T> at[kMostFieldPoints];
  Index room;
  Index count = 0;
  bool is_full = false;  ///< one was left out

  STICTION_HD explicit FieldPoints(Index places) : room(places) {}

  /// Adds the point of a round shape whose middle line is nearest there.
  STICTION_HD void add(const SurfacePoint<T>& nearest, T radius) {
    const T distance = nearest.distance - radius;
    Index place = count;
    if (count < room) {
      ++count;
    } else {
      is_full = true;
      place = 0;
      for (Index k = 1; k < count; ++k)
        if (at[k].depth < at[place].depth) place = k;
      if (!(-distance > at[place].depth)) return;
    }
    at[place] = {add_scaled(nearest.at, T(0.5) * distance, nearest.normal), nearest.normal, -distance, place};
  }
};

/// Adds where a capsule touches one prism: where it is nearest, and either end that is over it. `most`: of the distance
/// from the middle line.
template <class T>
STICTION_HD_OUTLINE void touch_prism(const FieldPrism<T>& prism, const Ends<T>& ends, T radius, T most,
                                     FieldPoints<T>& found) {
  const T nearer = radius * (sizeof(T) == sizeof(double) ? T(1e-9) : T(1e-5));
  if (pierces(ends, prism)) {
    Index face = -1;
    const SurfacePoint<T> best = way_out(prism, ends, nearer, face);
    found.add(best, radius);
    if (face < 0) return;
    const Index outer = prism.beyond(face, ends.at[1]) < prism.beyond(face, ends.at[0]) ? 0 : 1;
    const T beyond = prism.beyond(face, ends.at[outer]);
    if (beyond < most && prism.is_level_with(ends.at[outer]))
      found.add({add_scaled(ends.at[outer], -beyond, prism.normal[face]), prism.normal[face], beyond}, radius);
    return;
  }
  const SurfacePoint<T> end[2] = {nearest_surface(prism, ends.at[0]), nearest_surface(prism, ends.at[1])};
  const Index first = end[1].distance < end[0].distance ? 1 : 0;
  const SurfacePoint<T> middle = nearest_edge(prism, ends.axis);
  const bool is_between = middle.distance < end[first].distance - nearer;
  if (is_between && middle.distance < most) found.add(middle, radius);
  for (Index k = 0; k < 2; ++k)
    if (end[k].distance < most && ((k == first && !is_between) || prism.is_level_with(ends.at[k])))
      found.add(end[k], radius);
}

/// A sphere or a capsule, in the axes of the field.
template <class T>
STICTION_HD_OUTLINE void touch_round(const FieldGrid<T>& grid, const PlacedShape<T>& shape, T margin,
                                     FieldPoints<T>& found) {
  const T radius = shape.size[0], most = radius + margin;
  const Ends<T> ends({shape.centre, half_segment(shape)});
  const Vector3<T> wide{abs_(ends.axis.h.x) + most, abs_(ends.axis.h.y) + most, abs_(ends.axis.h.z) + most};
  grid.for_each_prism(subtract(shape.centre, wide), added(shape.centre, wide), [&](const FieldPrism<T>& prism) {
    for (Index face = 0; face < prism.kFaces; ++face)
      if (!(min_(prism.beyond(face, ends.at[0]), prism.beyond(face, ends.at[1])) < most)) return;
    if (shape.kind == ShapeKind::capsule) return touch_prism(prism, ends, radius, most, found);
    const SurfacePoint<T> nearest = nearest_surface(prism, shape.centre);
    if (nearest.distance < most) found.add(nearest, radius);
  });
}

/// Corners of a box, in the axes of the field.
template <class T>
STICTION_HD_OUTLINE void touch_corners(const FieldGrid<T>& grid, const PlacedShape<T>& box, T reach,
                                       FieldPoints<T>& found) {
  for (Index k = 0; k < 8 && found.count < 4; ++k) {
    const Vector3<T> corner = along(box.axes, corner_of<T>(box.size, k));
    const Vector3<T> p = added(box.centre, corner);
    if (!grid.is_over(p) || p.z < -grid.field.base) continue;
    const FieldPrism<T> prism(grid.triangle_at(p), -grid.field.base);
    const T distance = prism.beyond(0, p);
    if (distance <= reach && dot(prism.normal[0], corner) <= T(0))
      found.add({add_scaled(p, -distance, prism.normal[0]), prism.normal[0], distance}, T(0));
  }
}

/// Points of the grid, on ridges and peaks, that are in a box or near it, in the axes of the field.
template <class T>
STICTION_HD_OUTLINE void touch_ridges(const FieldGrid<T>& grid, const PlacedShape<T>& box, T margin,
                                      FieldPoints<T>& found) {
  const Vector3<T> wide{half_width(box, Vector3<T>{T(1), T(0), T(0)}) + margin,
                        half_width(box, Vector3<T>{T(0), T(1), T(0)}) + margin,
                        half_width(box, Vector3<T>{T(0), T(0), T(1)}) + margin};
  const Vector3<T> low = subtract(box.centre, wide), high = added(box.centre, wide);
  const Index last_row = grid.cell_at(1, high.y) + 1, last_column = grid.cell_at(0, high.x) + 1;
  for (Index row = grid.cell_at(1, low.y); row <= last_row; ++row)
    for (Index column = grid.cell_at(0, low.x); column <= last_column; ++column) {
      const Vector3<T> p = grid.vertex(row, column);
      const Vector3<T> own = components(box.axes, subtract(p, box.centre));
      const bool is_near = abs_(own.x) < box.size[0] + margin && abs_(own.y) < box.size[1] + margin &&
                           abs_(own.z) < box.size[2] + margin;
      if (!is_near || !grid.is_ridge(row, column)) continue;
      BoxPoints<T> point;
      touch_sphere(box, Triple<T>::of(own), T(0), point);
      const T distance = -point.at[0].depth;
      if (distance < margin) found.add({p, point.at[0].normal, distance}, T(0));
    }
}

/// Points of one lane's shape, in world axes.
template <class T>
STICTION_HD_OUTLINE FieldPoints<T> points_on_field(const FieldGrid<T>& grid, const PlacedShape<T>& frame,
                                                   const PlacedShape<T>& shape, const ArticulatedPairData<T>& pair) {
  FieldPoints<T> found(pair.points);
  const auto turned = [&](const Vector3<T>& v) { return components(frame.axes, v); };
  const PlacedShape<T> own{shape.kind,
                           turned(subtract(shape.centre, frame.centre)),
                           {turned(shape.axes.x), turned(shape.axes.y), turned(shape.axes.z)},
                           {shape.size[0], shape.size[1], shape.size[2]}};
  if (shape.kind == ShapeKind::box) {
    touch_corners(grid, own, pair.reach, found);
    touch_ridges(grid, own, pair.margin, found);
  } else {
    touch_round(grid, own, pair.margin, found);
  }
  for (Index k = 0; k < found.count; ++k) {
    found.at[k].point = added(frame.centre, along(frame.axes, found.at[k].point));
    found.at[k].normal = along(frame.axes, found.at[k].normal);
  }
  return found;
}

/// Returns a bit for each lane that had more points than places.
template <class Real, class T>
STICTION_HD unsigned touch_field_by_lane(const Robots<Real>& robots, const ArticulatedPairData<T>& pair,
                                         Mask<Real> near) {
  const FieldGrid<T> grid{robots.model.field[robots.model.geom[pair.geom_a].field], robots.model.height};
  unsigned full = 0;
  touch_by_lane(robots, pair, near, [&](int lane) {
    const FieldPoints<T> found =
        points_on_field(grid, shape_in(robots, pair.geom_a, lane), shape_in(robots, pair.geom_b, lane), pair);
    if (found.is_full) full |= 1U << lane;
    return found;
  });
  return full;
}

}  // namespace stiction::inline STICTION_ISA
