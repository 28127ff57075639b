#pragma once

#include <set>
#include <utility>
#include <vector>

#include "stiction/articulated.hpp"

namespace stiction::test {

/// Free bodies over a table, each of which may touch all others. All that are meshes have that hull.
inline ArticulatedDescription heap_of(const std::vector<GeomKind>& kinds,
                                      const std::vector<ArticulatedHull>& hulls = {}) {
  ArticulatedDescription model;
  model.hulls = hulls;
  model.timestep = 0.004;
  model.bodies.push_back({});
  model.geoms.push_back({0, GeomKind::box, {.6, .5, .1}, {}, {1, 0, 0, 0}});
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
    model.geoms.back().hull = kind == GeomKind::mesh ? 0 : -1;
  }
  model.dofs.resize(6 * kinds.size());
  const auto geoms = static_cast<Index>(model.geoms.size());
  for (Index a = 0; a < geoms; ++a)
    for (Index b = a + 1; b < geoms; ++b) {
      const auto kind = [&](Index g) { return model.geoms[static_cast<std::size_t>(g)].kind; };
      const bool ascends = kind(a) <= kind(b);
      model.pairs.push_back({ascends ? a : b, ascends ? b : a, 3, {.7, .7, .01, .001, .001}, .002, .004, {}, {}});
    }
  return model;
}
inline ArticulatedDescription heap() {
  return heap_of({GeomKind::box, GeomKind::capsule, GeomKind::capsule, GeomKind::sphere, GeomKind::box});
}

/// Kinds of geoms of all pairs that touch while environments step on.
inline std::set<std::pair<GeomKind, GeomKind>> touching_kinds(ArticulatedBatch<double>& robots,
                                                              const ArticulatedDescription& model) {
  std::set<std::pair<GeomKind, GeomKind>> touched;
  for (int round = 0; round < 10; ++round) {
    robots.step(20);
    const ArticulatedProbe probe = robots.probe();
    for (std::size_t env = 0; env < probe.contacts.size(); ++env)
      for (Index k = 0; k < probe.contacts[env]; ++k) {
        const auto at = env * static_cast<std::size_t>(probe.most_contacts) + static_cast<std::size_t>(k);
        const ArticulatedPair& pair = model.pairs[static_cast<std::size_t>(probe.pair[at])];
        const auto kind = [&](Index g) { return model.geoms[static_cast<std::size_t>(g)].kind; };
        touched.emplace(kind(pair.geom_a), kind(pair.geom_b));
      }
  }
  return touched;
}

}  // namespace stiction::test
