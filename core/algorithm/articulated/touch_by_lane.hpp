#pragma once

#include "core/algorithm/articulated/lane_numbers.hpp"
#include "core/algorithm/articulated/workspace.hpp"
#include "core/algorithm/collision/manifold.hpp"

/// Points that are found lane by lane: their choices branch too much for vectors.
namespace stiction::inline STICTION_ISA {

/// One lane's axes of a geom: all of them are z of one that is round about it.
template <class Real, int kStride>
STICTION_HD Axes3<Scalar<Real>> axes_in(const Robots<Real, kStride>& robots, Index g, int lane) {
  const Axes3<Real>& axes = robots.work.geom_axes[g];
  const bool has_axes = has_three_axes(robots.model.geom[g].kind);
  const Vector3<Scalar<Real>> z = vector_in(axes.z, lane);
  return {has_axes ? vector_in(axes.x, lane) : z, has_axes ? vector_in(axes.y, lane) : z, z};
}

/// One lane's shape, placed. A height field has the place of its frame.
template <class Real, int kStride>
STICTION_HD PlacedShape<Scalar<Real>> shape_in(const Robots<Real, kStride>& robots, Index g, int lane) {
  const auto& geom = robots.model.geom[g];
  const ShapeKind kind = has_three_axes(geom.kind)        ? ShapeKind::box
                         : geom.kind == GeomKind::capsule ? ShapeKind::capsule
                                                          : ShapeKind::sphere;
  return {kind,
          vector_in(robots.work.geom_position[g], lane),
          axes_in(robots, g, lane),
          {geom.size[0], geom.size[1], geom.size[2]}};
}

/// Writes down what lanes that are near find: find(lane) has points `at` and their `count`. A place that a lane has no
/// point for is beyond every margin there.
template <class Real, int kStride, class T, class F>
STICTION_HD_OUTLINE void touch_by_lane(const Robots<Real, kStride>& robots, const ArticulatedPairData<T>& pair,
                                       Mask<Real> near, F&& find) {
  constexpr int kLanes = RealTraits<Real>::kLanes;
  constexpr T kFar = T(1e30);
  auto& work = robots.work;
  for (Index k = 0; k < pair.points; ++k) {
    work.distance[pair.first + k] = Real(kFar);
    work.point.put(pair.first + k, no_vector<Real>());
    work.normal.put(pair.first + k, no_vector<Real>());
  }
  const auto put = [&](const auto& vectors, Index at, int lane, const Vector3<T>& v) {
    const auto numbers = vectors.from(at).template as<Real>().numbers();
    numbers.at(0, lane) = v.x;
    numbers.at(1, lane) = v.y;
    numbers.at(2, lane) = v.z;
  };
  for (int lane = 0; lane < kLanes; ++lane) {
    if (!is_set(near, lane)) continue;
    const auto& found = find(lane);
    for (Index k = 0; k < found.count && k < pair.points; ++k) {
      work.distance.numbers().at(pair.first + k, lane) = -found.at[k].depth;
      put(work.point, pair.first + k, lane, found.at[k].point);
      put(work.normal, pair.first + k, lane, found.at[k].normal);
    }
  }
  for (Index k = 0; k < pair.points; ++k) {
    work.touches[pair.first + k] = work.distance[pair.first + k] < Real(pair.margin);
    work.is_point[pair.first + k] = any(work.touches[pair.first + k]) ? 1 : 0;
  }
}

}  // namespace stiction::inline STICTION_ISA
