#pragma once

#include "core/algorithm/articulated/touch_by_lane.hpp"
#include "core/algorithm/collision/plane_contacts.hpp"

/// Points of a mesh on a plane, by its convex hull. They are MuJoCo 4.0's: the lowest vertex, and others below the
/// centre of that of its faces that looks down the most.
namespace stiction::inline STICTION_ISA {

/// Points of one lane.
template <class T>
struct HullPoints {
  ContactCandidate<T> at[4];
  Index count = 0;
};

/// A hull in one lane: normal of the plane in the geom's axes, and height of its centre.
template <class T>
struct HullOnPlane {
  const ArticulatedModelView<T>& model;
  const ArticulatedPairData<T>& pair;
  Vector3<T> centre;
  Axes3<T> axes;
  Vector3<T> down;  ///< minus the plane's normal, in the geom's axes
  T height;

  [[nodiscard]] STICTION_HD HullPoints<T> points(Index lowest) const {
    const auto& vertex = model.vertex[lowest];
    Index chosen = vertex.face_begin;
    T most(-2);
    for (Index f = vertex.face_begin; f < vertex.face_end; ++f) {
      const T along_down = dot(down, in_lanes<T>(model.face[f].normal));
      if (along_down > most) chosen = f;
      most = max_(along_down, most);
    }
    HullPoints<T> found;
    add(found, lowest);
    if (chosen == vertex.face_end) return found;
    const auto& face = model.face[chosen];
    for (Index k = 0; k < face.others; ++k) add(found, face.other[k]);
    return found;
  }
  /// Adds a vertex below the centre and within reach.
  STICTION_HD void add(HullPoints<T>& found, Index v) const {
    const Vector3<T> place = in_lanes<T>(model.vertex[v].place);
    const T below = dot(down, place), distance = height - below;
    if (!(distance <= pair.reach) || below < T(0)) return;
    const Vector3<T> point = added(centre, along(axes, place));
    found.at[found.count] = on_plane(in_lanes<T>(pair.normal), point, distance, -distance, found.count);
    ++found.count;
  }
};

/// `height`: of the centre above the plane.
template <class Real, int kStride, class T>
STICTION_HD void touch_hull(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair, Real height,
                            const Vector3<Real>& normal) {
  const auto& model = robots.model;
  const auto& geom = model.geom[pair.geom_b];
  const Axes3<Real>& axes = robots.work.geom_axes[pair.geom_b];
  const Vector3<Real> down = scaled(Real(-1), {dot(normal, axes.x), dot(normal, axes.y), dot(normal, axes.z)});
  Real lowest(T(-1e30)), number(0);
  for (Index v = geom.hull_begin; v < geom.hull_end; ++v) {
    const Real below = dot(down, in_lanes<Real>(model.vertex[v].place));
    const auto is_lower = below > lowest;
    lowest = select(is_lower, below, lowest);
    number = select(is_lower, Real(static_cast<T>(v - geom.hull_begin)), number);
  }
  const auto near = height - lowest <= Real(pair.reach);
  if (!any(near)) return;
  touch_by_lane(robots, pair, near, [&](int lane) {
    const HullOnPlane<T> own{model,
                             pair,
                             vector_in(robots.work.geom_position[pair.geom_b], lane),
                             axes_in(robots, pair.geom_b, lane),
                             vector_in(down, lane),
                             number_in(height, lane)};
    return own.points(geom.hull_begin + static_cast<Index>(number_in(number, lane)));
  });
}

}  // namespace stiction::inline STICTION_ISA
