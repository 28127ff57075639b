#pragma once

#include "stiction/articulated.hpp"

namespace stiction::test {

/// Free bodies over a table, each of which may touch all others.
inline ArticulatedDescription heap() {
  ArticulatedDescription model;
  model.timestep = 0.004;
  model.bodies.push_back({});
  model.geoms.push_back({0, GeomKind::box, {.6, .5, .1}, {}, {1, 0, 0, 0}});
  const GeomKind kinds[] = {GeomKind::box, GeomKind::capsule, GeomKind::capsule, GeomKind::sphere, GeomKind::box};
  for (const GeomKind kind : kinds) {
    const auto body = static_cast<Index>(model.bodies.size());
    const double height = 0.1 + 0.13 * static_cast<double>(body);
    model.bodies.push_back({0,
                            1,
                            {.03 * static_cast<double>(body), .02, height},
                            {0.6, 0.8, 0, 0},
                            1,
                            {},
                            {1, 0, 0, 0},
                            {.01, .012, .014},
                            {1, 80}});
    model.joints.push_back({});
    model.joints.back().kind = JointKind::free;
    model.geoms.push_back({body, kind, {.08, .12, .06}, {0, .01, 0}, {1, 0, 0, 0}});
  }
  model.dofs.resize(30);
  for (Index a = 0; a < 6; ++a)
    for (Index b = a + 1; b < 6; ++b) {
      const auto kind = [&](Index g) { return model.geoms[static_cast<std::size_t>(g)].kind; };
      const bool ascends = kind(a) <= kind(b);
      model.pairs.push_back({ascends ? a : b, ascends ? b : a, 3, {.7, .7, .01, .001, .001}, .002, .004, {}, {}});
    }
  return model;
}

}  // namespace stiction::test
