#pragma once

#include "stiction/bodies.hpp"
#include "tests/support/box_scenes.hpp"

namespace stiction::test {

/// Boxes of a scene as bodies: mass 1, under weight for a step of `dt`, standing still.
inline BodyEnvironment<double> box_bodies(const BoxScene& scene, double mu, double dt = 0.005) {
  BodyEnvironment<double> env;
  for (std::size_t k = 0; k < scene.centres.size(); ++k) {
    auto& body = env.bodies.emplace_back();
    for (const std::size_t axis : {std::size_t{0}, std::size_t{1}, std::size_t{2}}) {
      const double y = scene.half[(axis + 1) % 3], z = scene.half[(axis + 2) % 3];
      const std::size_t diagonal[3] = {0, 3, 5};
      body.inv_inertia[diagonal[axis]] = 3 / (y * y + z * z);
    }
    body.twist_change = {0, 0, -9.81 * dt, 0, 0, 0};
  }
  for (const BoxContact& from : scene.contacts) {
    auto& contact = env.contacts.emplace_back();
    contact.body_a = from.a;
    contact.body_b = from.b;
    contact.mu = mu;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (from.a >= 0) contact.arm_a[axis] = from.at[axis] - scene.centres[static_cast<std::size_t>(from.a)][axis];
      contact.arm_b[axis] = from.at[axis] - scene.centres[static_cast<std::size_t>(from.b)][axis];
    }
  }
  return env;
}

}  // namespace stiction::test
