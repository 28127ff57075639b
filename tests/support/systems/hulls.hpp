#pragma once

#include "tests/support/systems/rough_ground.hpp"

namespace stiction::test {

/// A prism of 0.2 m height whose ends have seven corners.
inline ArticulatedHull prism() {
  constexpr double kRing[7][2] = {{.2, 0},      {.14, .15},   {-.02, .19}, {-.16, .12},
                                  {-.19, -.05}, {-.08, -.17}, {.1, -.16}};
  ArticulatedHull hull{{}, {0}, {}};
  for (const double z : {-.1, .1})
    for (const auto& corner : kRing) hull.vertices.push_back({corner[0], corner[1], z});
  const auto add_face = [&](const std::vector<Index>& corners) {
    hull.corners.insert(hull.corners.end(), corners.begin(), corners.end());
    hull.face_begin.push_back(static_cast<Index>(hull.corners.size()));
  };
  add_face({6, 5, 4, 3, 2, 1, 0});
  add_face({7, 8, 9, 10, 11, 12, 13});
  for (Index k = 0; k < 7; ++k) add_face({k, (k + 1) % 7, 7 + (k + 1) % 7, 7 + k});
  return hull;
}

/// A free prism over the ground, geom 0.
inline void add_free_prism(ArticulatedDescription& model, std::array<double, 3> place) {
  add_free_body(model, GeomKind::mesh, {}, place);
  model.geoms.back().hull = static_cast<Index>(model.hulls.size());
  model.hulls.push_back(prism());
}

/// A walker beside a prism that falls by itself.
inline ArticulatedDescription walker_and_prism(bool is_elliptic) {
  ArticulatedDescription model = walker(is_elliptic);
  add_free_prism(model, {1, 0, .25});
  return model;
}

}  // namespace stiction::test
