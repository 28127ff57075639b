#pragma once

#include <cmath>
#include <vector>

#include "scenes/box_scenes.hpp"
#include "tests/support/systems/jacobian_systems.hpp"

/// Boxes that rest on each other, as J and M.
namespace stiction::test {

struct BoxRecipe {
  double mu = 0.5;
  double compliance = 0.0;  ///< R of normal rows; tangential rows have it over mu^2
  double heavy = 1.0;       ///< mass of every third box; the others have mass 1
  double push = 0.0;        ///< sideways velocity before contact, in parts of the weight's
};

/// Blocks of 6 x 6 in M, J in stored entries. Velocities are those of a step under weight.
inline JacobianEnvironment<double> boxes_as_jacobian(const scenes::BoxScene& scene, const BoxRecipe& recipe) {
  JacobianEnvironment<double> env;
  for (Index body = 0; body < scene.bodies(); ++body) {
    const double mass = body % 3 == 0 ? recipe.heavy : 1.0;
    double block[36] = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double y = scene.half[(axis + 1) % 3], z = scene.half[(axis + 2) % 3];
      block[7 * axis] = mass;
      block[7 * (axis + 3)] = mass * (y * y + z * z) / 3.0;
    }
    env.M.insert(env.M.end(), block, block + 36);
    for (const double v : {0.05 * recipe.push * std::sin(body), 0.02 * recipe.push, -0.05, 0.0, 0.0, 0.0})
      env.v_free.push_back(v);
  }
  env.row_offsets = {0};
  for (const scenes::BoxContact& contact : scene.contacts) {
    env.cones.push_back(friction(3));
    // The normal is the vertical; tangents are x and y.
    for (const std::size_t axis : {std::size_t{2}, std::size_t{0}, std::size_t{1}}) {
      const bool is_normal = axis == 2;
      for (const Index body : {contact.a, contact.b}) {
        if (body < 0) continue;
        const double sign = body == contact.b ? 1.0 : -1.0;
        const auto& centre = scene.centres[static_cast<std::size_t>(body)];
        const std::size_t next = (axis + 1) % 3, last = (axis + 2) % 3;
        // (arm x e)_next = arm_last, (arm x e)_last = -arm_next for a unit vector e along the axis.
        const std::size_t columns[3] = {axis, 3 + next, 3 + last};
        const double values[3] = {sign, sign * (contact.at[last] - centre[last]),
                                  -sign * (contact.at[next] - centre[next])};
        for (int k = 0; k < 3; ++k) {
          env.column.push_back(static_cast<Index>(6 * body) + static_cast<Index>(columns[k]));
          env.J.push_back(values[k]);
        }
      }
      env.row_offsets.push_back(static_cast<Index>(env.J.size()));
      env.mu.push_back(is_normal ? 0.0 : recipe.mu);
      env.R.push_back(is_normal || recipe.mu == 0.0 ? recipe.compliance : recipe.compliance / (recipe.mu * recipe.mu));
    }
  }
  return env;
}

}  // namespace stiction::test
