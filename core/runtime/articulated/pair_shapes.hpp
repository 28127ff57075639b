#pragma once

#include <cmath>

#include "stiction/articulated.hpp"

/// Facts about two geoms that may touch.
namespace stiction {

/// Farthest that a geom reaches from its centre.
inline double radius_of(const ArticulatedGeom& geom) {
  const auto& s = geom.size;
  if (geom.kind == GeomKind::capsule) return s[0] + s[1];
  if (geom.kind == GeomKind::cylinder) return std::sqrt(s[0] * s[0] + s[1] * s[1]);
  if (geom.kind == GeomKind::box) return std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
  return s[0];
}

/// Most points that two geoms touch in, kinds in ascending order.
inline Index points_of(const ArticulatedGeom& a, const ArticulatedGeom& b) {
  if (a.kind == GeomKind::sphere || b.kind == GeomKind::sphere) return 1;
  if (b.kind == GeomKind::cylinder) return 4;
  return a.kind == GeomKind::capsule || b.kind == GeomKind::capsule ? 2 : 8;
}

}  // namespace stiction
