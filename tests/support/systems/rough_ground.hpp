#pragma once

#include "tests/support/systems/walker_states.hpp"

namespace stiction::test {

/// A field of 9 by 7 heights from 0 to `high`, at random, a little below the origin.
inline ArticulatedHeightField rough_field(double high) {
  ArticulatedHeightField field{9, 7, {.6, .8}, .1, {}};
  for (std::uint64_t k = 0; k < 63; ++k) field.heights.push_back(high * (0.5 + 0.5 * number(k)));
  return field;
}

/// A free body with a shape, above the ground, geom 0.
inline void add_free_body(ArticulatedDescription& model, GeomKind kind, std::array<double, 3> size,
                          std::array<double, 3> place) {
  const auto body = static_cast<Index>(model.bodies.size()), geom = static_cast<Index>(model.geoms.size());
  model.bodies.push_back({0, 1, place, {.6, 0, .8, 0}, 2, {.02, .01, 0}, {1, 0, 0, 0}, {.01, .03, .02}, {.5, 30}});
  model.joints.push_back({});
  model.joints.back().kind = JointKind::free;
  model.dofs.resize(model.dofs.size() + 6);
  model.geoms.push_back({body, kind, size, {}, {1, 0, 0, 0}});
  model.pairs.push_back({0, geom, 3, {.7, .7, .01, .001, .001}, .002, .003, {}, {}});
}

/// A walker, a box and a log over rough ground.
inline ArticulatedDescription rough_walk(bool is_elliptic) {
  ArticulatedDescription model = walker(is_elliptic);
  model.fields.push_back(rough_field(.08));
  model.geoms[0] = {0, GeomKind::height_field, {}, {.02, -.01, -.05}, {.8, 0, 0, .6}, 0};
  add_free_body(model, GeomKind::box, {.2, .1, .15}, {.4, .2, .3});
  add_free_body(model, GeomKind::capsule, {.05, .15}, {-.3, .3, .2});
  return model;
}

}  // namespace stiction::test
