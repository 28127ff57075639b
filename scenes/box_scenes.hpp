#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "stiction/bodies.hpp"

/// Boxes that rest on each other: towers, walls and pyramids, on which Gauss-Seidel is slow.
namespace stiction::scenes {

/// A contact whose normal is the vertical; a is -1 for the floor.
struct BoxContact {
  Index a = -1, b = 0;
  std::array<double, 3> at{};
};

/// Boxes of mass 1 and one size; contacts at the corners of where two of them overlap.
struct BoxScene {
  std::array<double, 3> half{0.5, 0.5, 0.5};
  std::vector<std::array<double, 3>> centres;
  std::vector<BoxContact> contacts;

  [[nodiscard]] Index bodies() const { return static_cast<Index>(centres.size()); }

  /// Lets b rest on a, or on the floor.
  void rest(Index a, Index b) {
    const std::array<double, 3>& upper = centres[static_cast<std::size_t>(b)];
    std::array<double, 3> low{upper[0] - half[0], upper[1] - half[1], upper[2] - half[2]};
    std::array<double, 3> high{upper[0] + half[0], upper[1] + half[1], low[2]};
    if (a >= 0)
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const double centre = centres[static_cast<std::size_t>(a)][axis];
        low[axis] = std::max(low[axis], centre - half[axis]);
        high[axis] = std::min(high[axis], centre + half[axis]);
      }
    for (const double x : {low[0], high[0]})
      for (const double y : {low[1], high[1]}) contacts.push_back({a, b, {x, y, low[2]}});
  }
};

inline BoxScene box_tower(Index boxes) {
  BoxScene scene;
  for (Index i = 0; i < boxes; ++i) {
    scene.centres.push_back({0.0, 0.0, 0.5 + i});
    scene.rest(i - 1, i);
  }
  return scene;
}

/// Bricks twice as long as high, each course half a brick beside the one below.
inline BoxScene box_wall(Index courses, Index bricks) {
  BoxScene scene;
  scene.half = {1.0, 0.5, 0.5};
  for (Index course = 0; course < courses; ++course)
    for (Index brick = 0; brick < bricks; ++brick) {
      const Index body = scene.bodies();
      scene.centres.push_back({2.0 * brick + course % 2, 0.0, 0.5 + course});
      if (course == 0) {
        scene.rest(-1, body);
        continue;
      }
      const Index left = brick - (course % 2 == 0 ? 1 : 0);
      for (const Index below : {left, left + 1})
        if (below >= 0 && below < bricks) scene.rest((course - 1) * bricks + below, body);
    }
  return scene;
}

/// Square courses of cubes, each cube on four of the course below: 385 of them in 10 courses.
inline BoxScene box_pyramid(Index courses) {
  BoxScene scene;
  Index first_below = -1;
  for (Index side = courses; side > 0; --side) {
    const Index first = scene.bodies();
    const double shift = 0.5 * (courses - side);
    for (Index x = 0; x < side; ++x)
      for (Index y = 0; y < side; ++y) {
        const Index body = scene.bodies();
        scene.centres.push_back({x + shift, y + shift, 0.5 + (courses - side)});
        if (first_below < 0) {
          scene.rest(-1, body);
        } else {
          for (const Index dx : {0, 1})
            for (const Index dy : {0, 1}) scene.rest(first_below + (x + dx) * (side + 1) + y + dy, body);
        }
      }
    first_below = first;
  }
  return scene;
}

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

}  // namespace stiction::scenes
