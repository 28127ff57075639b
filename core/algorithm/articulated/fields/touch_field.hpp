#pragma once

#include "core/algorithm/articulated/boxes/sphere_box.hpp"
#include "core/algorithm/articulated/fields/grid.hpp"
#include "core/algorithm/articulated/fields/prism_queue.hpp"
#include "core/algorithm/articulated/touch_by_lane.hpp"
#include "core/algorithm/collision/box_axes.hpp"
#include "core/algorithm/collision/plane_contacts.hpp"

/// Points at which spheres, capsules and boxes touch a height field. MuJoCo has a point for each of the field's prisms
/// that is nearer than the margin (MuJoCo documentation, "Collision detection"). Spheres and capsules have these.
/// Ends of capsules over the prism are points as well, as on planes. Boxes touch by corners, the first four below their
/// centre, as on planes, and by ridges and peaks of the field.
namespace stiction::inline STICTION_ISA {

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

/// Points of a geom in every lane.
template <class Real>
class FieldTouch {
 public:
  using T = Scalar<Real>;
  static constexpr int kLanes = RealTraits<Real>::kLanes;

  /// `any`: a lane's shape, whose kind and size are those of all.
  STICTION_HD FieldTouch(const FieldGrid<T>& grid, const ArticulatedPairData<T>& pair, const PlacedShape<T>& any)
      : grid_(grid),
        pair_(pair),
        prisms_(any.kind == ShapeKind::capsule, any.size[0], pair.margin, -grid.field.base, found_) {
    for (auto& found : found_) found.room = pair.points;
  }

  /// Takes a lane's shape in, and the field's frame.
  STICTION_HD void add(int lane, const PlacedShape<T>& frame, const PlacedShape<T>& shape) {
    const auto turned = [&](const Vector3<T>& v) { return components(frame.axes, v); };
    const PlacedShape<T> own{shape.kind,
                             turned(subtract(shape.centre, frame.centre)),
                             {turned(shape.axes.x), turned(shape.axes.y), turned(shape.axes.z)},
                             {shape.size[0], shape.size[1], shape.size[2]}};
    if (shape.kind != ShapeKind::box) return add_round(lane, own);
    touch_corners(grid_, own, pair_.reach, found_[lane]);
    touch_ridges(grid_, own, pair_.margin, found_[lane]);
  }

  /// Finds the points of all shapes. To be called once, after the last of them.
  STICTION_HD void finish() { prisms_.touch(); }

  /// A lane's points in world axes, by the field's frame. To be asked for once.
  [[nodiscard]] STICTION_HD const FieldPoints<T>& points(int lane, const PlacedShape<T>& frame) {
    FieldPoints<T>& found = found_[lane];
    for (Index k = 0; k < found.count; ++k) {
      found.at[k].point = added(frame.centre, along(frame.axes, found.at[k].point));
      found.at[k].normal = along(frame.axes, found.at[k].normal);
    }
    return found;
  }

 private:
  /// A sphere or a capsule, in the axes of the field.
  STICTION_HD_OUTLINE void add_round(int lane, const PlacedShape<T>& shape) {
    const T most = shape.size[0] + pair_.margin;
    const Ends<T> ends({shape.centre, half_segment(shape)});
    const Vector3<T>& h = ends.axis.h;
    const Vector3<T> wide{abs_(h.x) + most, abs_(h.y) + most, abs_(h.z) + most};
    grid_.for_each_top(subtract(shape.centre, wide), added(shape.centre, wide), [&](const Triangle3<T>& top) {
      if (!is_beyond(top, ends, most)) prisms_.add(lane, ends.axis, top);
    });
  }

  const FieldGrid<T>& grid_;
  const ArticulatedPairData<T>& pair_;
  FieldPoints<T> found_[kLanes];
  PrismQueue<Real> prisms_;
};

/// Returns a bit for each lane that had more points than places.
template <class Real, int kStride, class T>
STICTION_HD unsigned touch_field_by_lane(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair,
                                         Mask<Real> near) {
  constexpr int kLanes = RealTraits<Real>::kLanes;
  const FieldGrid<T> grid{robots.model.field[robots.model.geom[pair.geom_a].field], robots.model.height};
  FieldTouch<Real> touch(grid, pair, shape_in(robots, pair.geom_b, 0));
  for (int lane = 0; lane < kLanes; ++lane)
    if (is_set(near, lane)) touch.add(lane, shape_in(robots, pair.geom_a, lane), shape_in(robots, pair.geom_b, lane));
  touch.finish();
  unsigned full = 0;
  touch_by_lane(robots, pair, near, [&](int lane) -> const FieldPoints<T>& {
    const FieldPoints<T>& found = touch.points(lane, shape_in(robots, pair.geom_a, lane));
    if (found.is_full) full |= 1U << lane;
    return found;
  });
  return full;
}

}  // namespace stiction::inline STICTION_ISA
