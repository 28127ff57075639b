#pragma once

#include <algorithm>
#include <cmath>

#include "core/base/extents.hpp"
#include "core/job/articulated_job.hpp"

/// Facts about two geoms that may touch.
namespace stiction {

/// Farthest that a geom reaches from its centre.
inline double radius_of(const ArticulatedDescription& model, const ArticulatedGeom& geom) {
  const auto& s = geom.size;
  if (geom.kind == GeomKind::mesh) {
    double most = 0;
    for (const auto& v : model.hulls[at(geom.hull)].vertices) {
      const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
      if (length > most) most = length;
    }
    return most;
  }
  if (geom.kind == GeomKind::capsule) return s[0] + s[1];
  if (geom.kind == GeomKind::cylinder) return std::sqrt(s[0] * s[0] + s[1] * s[1]);
  if (geom.kind == GeomKind::box) return std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
  return s[0];
}

/// Farthest that it reaches up from its frame, on which other geoms stand, or from its centre.
inline double height_of(const ArticulatedDescription& model, const ArticulatedGeom& geom) {
  if (geom.kind == GeomKind::plane) return 0;
  if (geom.kind != GeomKind::height_field) return radius_of(model, geom);
  const auto& heights = model.fields[at(geom.field)].heights;
  return *std::max_element(heights.begin(), heights.end());
}

/// Most points that two geoms touch in, kinds in ascending order. On a height field a sphere is on the eight triangles
/// of four cells. Capsules and boxes have twice as many.
inline Index points_of(const ArticulatedGeom& a, const ArticulatedGeom& b) {
  if (a.kind == GeomKind::height_field) return b.kind == GeomKind::sphere ? kMostFieldPoints / 2 : kMostFieldPoints;
  if (a.kind == GeomKind::sphere || b.kind == GeomKind::sphere) return 1;
  if (a.kind == GeomKind::capsule || b.kind == GeomKind::capsule) return 2;
  return is_general(a.kind) || is_general(b.kind) ? 4 : 8;
}

}  // namespace stiction
