#pragma once

#include <array>

#include "core/base/extents.hpp"
#include "core/job/articulated_job.hpp"

/// Planes in the world: their bodies never move.
namespace stiction {

using Matrix3 = std::array<double, 9>;  ///< columns

inline Matrix3 axes_from(const std::array<double, 4>& q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z),     2 * (x * z - w * y),
          2 * (x * y - w * z),     1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
          2 * (x * z + w * y),     2 * (y * z - w * x),     1 - 2 * (x * x + y * y)};
}

/// Points p with normal' p = offset.
struct GroundPlane {
  std::array<double, 3> normal;
  double offset;
};

inline GroundPlane ground_plane(const ArticulatedDescription& from, const ArticulatedGeom& geom) {
  const Matrix3 axes = axes_from(geom.orientation);
  std::array<double, 3> normal{axes[6], axes[7], axes[8]}, place = geom.position;
  for (Index body = geom.body; body > 0; body = from.bodies[at(body)].parent) {
    const Matrix3 own = axes_from(from.bodies[at(body)].orientation);
    const auto turn = [&](const std::array<double, 3>& v) {
      return std::array<double, 3>{own[0] * v[0] + own[3] * v[1] + own[6] * v[2],
                                   own[1] * v[0] + own[4] * v[1] + own[7] * v[2],
                                   own[2] * v[0] + own[5] * v[1] + own[8] * v[2]};
    };
    normal = turn(normal);
    place = turn(place);
    for (std::size_t k = 0; k < 3; ++k) place[k] += from.bodies[at(body)].position[k];
  }
  return {normal, normal[0] * place[0] + normal[1] * place[1] + normal[2] * place[2]};
}

}  // namespace stiction
