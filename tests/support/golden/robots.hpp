#pragma once

#include <span>
#include <string>
#include <utility>

#include "tests/support/golden/case.hpp"
#include "tests/support/systems/hulls.hpp"

/// Golden rows of robots in lanes: "robots/walker/INTEGRATOR CONES/PRECISION", of states, records and observed arrays.
namespace stiction::test {

/// A walker beside a box that flies and falls by itself.
inline ArticulatedDescription walker_and_crate(bool is_elliptic) {
  ArticulatedDescription model = walker(is_elliptic);
  add_free_body(model, GeomKind::box, {.2, .1, .15}, {1, 0, 0.3});
  model.pairs.back().margin = model.pairs.back().reach = 0;
  model.is_implicit_fast = true;
  return model;
}

/// A walker beside a box, on which a prism lies, and a cylinder on that.
inline ArticulatedDescription walker_and_stack(bool is_elliptic) {
  ArticulatedDescription model = walker_and_crate(is_elliptic);
  const auto crate = static_cast<Index>(model.geoms.size()) - 1;
  add_free_prism(model, {1.05, 0, .59});
  add_free_body(model, GeomKind::cylinder, {.1, .08}, {1, 0, .78});
  ArticulatedPair pair = model.pairs.back();
  for (const auto& [a, b] : {std::pair{crate, crate + 1}, std::pair{crate + 2, crate + 1}}) {
    pair.geom_a = a;
    pair.geom_b = b;
    model.pairs.push_back(pair);
  }
  return model;
}

template <class Real>
std::uint64_t robots_digest(const ArticulatedDescription& model, bool varies, Device device) {
  ArticulatedOptions options{1e-5, 100, 2, varies, {}};
  if (varies) options.varies = {VariedArray::body_mass, VariedArray::pair_friction, VariedArray::actuator_gain};
  ArticulatedBatch<Real> robots(device, model, kEnvs, options);
  put_states(robots, all_envs());
  for (const VariedArray array : options.varies) {
    const std::span<Real> numbers = robots.varied(array);
    for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] *= static_cast<Real>(1 + 0.25 * number(k));
  }
  robots.step(25);
  Digest digest;
  digest.add(robots.hash()).add(robots.status());
  if (varies) digest.add(hash_bits(std::span<const Real>(robots.observed(ObservedArray::cfrc_ext))));
  return digest.value();
}

inline void add_robot_goldens(GoldenCases& cases) {
  for (const bool is_elliptic : {false, true}) {
    const std::string cones = is_elliptic ? " elliptic" : " pyramids";
    const auto add = [&](const char* integrator, const ArticulatedDescription& model, bool varies) {
      add_precisions(cases, "robots/walker/" + (integrator + cones), [model, varies](auto real, Device device) {
        return robots_digest<decltype(real)>(model, varies, device);
      });
    };
    add("euler", walker(is_elliptic), false);
    add("rk4", walker(is_elliptic, true), false);
    add("implicitfast", walker_and_crate(is_elliptic), false);
    add("varied", walker(is_elliptic), true);
    add("height field", rough_walk(is_elliptic), false);
    add("hull", walker_and_prism(is_elliptic), false);
    add("convex", walker_and_stack(is_elliptic), false);
  }
}

}  // namespace stiction::test
