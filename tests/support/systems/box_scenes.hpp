#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "core/algorithm/linear/block/block_matrix.hpp"
#include "scenes/box_scenes.hpp"

/// Body-space matrices of boxes that rest on each other, H = M + J'WJ, written out from the definitions.
namespace stiction::test {

using scenes::box_pyramid;
using scenes::box_tower;
using scenes::box_wall;
using scenes::BoxContact;
using scenes::BoxScene;
using Point = std::array<double, 3>;

/// Bodies anywhere that touch each other at random points: with chance 1 a clique, with chance 0 free bodies.
inline BoxScene random_touching(unsigned seed, Index bodies, double chance) {
  BoxScene scene;
  std::mt19937 random(seed);
  const auto unit = [&] { return static_cast<double>(random()) * 0x1p-32; };
  const auto point = [&] { return Point{unit(), unit(), unit()}; };
  for (Index i = 0; i < bodies; ++i) scene.centres.push_back(point());
  for (Index b = 0; b < bodies; ++b)
    for (Index a = 0; a < b; ++a)
      if (unit() < chance)
        for (int k = 0; k < 2; ++k) scene.contacts.push_back({a, b, point()});
  return scene;
}

/// A matrix that owns its pattern and its blocks.
struct BlockSystem {
  std::vector<Index> stream;
  std::vector<double> values;

  [[nodiscard]] BlockPattern pattern() const {
    const Index* next = stream.data();
    return take_pattern(next);
  }
  [[nodiscard]] BlockMatrix matrix() { return {pattern(), values.data()}; }
};

/// H of a scene with compliance R on every contact. `sliding` percent of the contacts have no stiffness along the
/// second axis, and another `sliding` percent have none at all.
inline BlockSystem box_matrix(const BoxScene& scene, double compliance, unsigned sliding = 0) {
  using Block36 = std::array<double, kBlockEntries>;
  std::map<std::pair<Index, Index>, Block36> blocks;
  const Point& half = scene.half;
  for (Index body = 0; body < scene.bodies(); ++body) {
    Block36& K = blocks[{body, body}];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double other = half[(axis + 1) % 3] * half[(axis + 1) % 3] + half[(axis + 2) % 3] * half[(axis + 2) % 3];
      K[axis * 7] = 1.0;
      K[(axis + 3) * 7] = other / 3.0;
    }
  }
  std::mt19937 random(17);
  for (const BoxContact& contact : scene.contacts) {
    const auto chance = random() % 100;
    Point w{1.0 / compliance, 1.0 / compliance, 1.0 / compliance};
    if (chance < sliding) w[1] = 0.0;
    if (chance >= sliding && chance < 2 * sliding) w = {0.0, 0.0, 0.0};
    // Velocity of the contact's point on each side, (I, -[arm]x), with its sign.
    std::array<std::array<double, 18>, 2> J{};
    const std::array<Index, 2> bodies{contact.a, contact.b};
    for (std::size_t side = 0; side < 2; ++side) {
      if (bodies[side] < 0) continue;
      const double sign = side == 0 ? -1.0 : 1.0;
      const Point& centre = scene.centres[static_cast<std::size_t>(bodies[side])];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t next = (axis + 1) % 3, last = (axis + 2) % 3;
        J[side][axis * 6 + axis] = sign;
        J[side][axis * 6 + 3 + next] = sign * (contact.at[last] - centre[last]);
        J[side][axis * 6 + 3 + last] = -sign * (contact.at[next] - centre[next]);
      }
    }
    for (std::size_t p = 0; p < 2; ++p)
      for (std::size_t q = 0; q < 2; ++q) {
        if (bodies[p] < 0 || bodies[q] < 0) continue;
        Block36& K = blocks[{bodies[p], bodies[q]}];
        for (std::size_t i = 0; i < 6; ++i)
          for (std::size_t j = 0; j < 6; ++j)
            for (std::size_t axis = 0; axis < 3; ++axis)
              K[i * 6 + j] += J[p][axis * 6 + i] * w[axis] * J[q][axis * 6 + j];
      }
  }
  BlockSystem system;
  system.stream = {scene.bodies(), scene.bodies()};
  system.stream.resize(static_cast<std::size_t>(scene.bodies()) + 3, 0);
  for (const auto& [place, K] : blocks) {
    ++system.stream[static_cast<std::size_t>(place.first) + 3];
    system.stream.push_back(place.second);
    system.values.insert(system.values.end(), K.begin(), K.end());
  }
  for (Index row = 0; row < scene.bodies(); ++row)
    system.stream[static_cast<std::size_t>(row) + 3] += system.stream[static_cast<std::size_t>(row) + 2];
  return system;
}

}  // namespace stiction::test
