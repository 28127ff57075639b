#pragma once

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/support/systems/worlds.hpp"

/// Worlds of all kinds of shapes in random places, some of them hopeless.
namespace stiction::test {

/// Parts of a random world.
struct RandomWorld {
  int bodies = 60;
  double spread = 1;      ///< half width of the cube that bodies begin in [m]
  double size_ratio = 4;  ///< of the largest shape to the smallest
  bool broken = false;    ///< some bodies are nowhere, infinitely far, or too fast
};

inline WorldShape random_shape(Index body, double size_ratio, std::mt19937_64& random) {
  std::uniform_real_distribution<double> any(-1, 1), grown(0, 1);
  const auto length = [&] { return 0.05 * std::pow(size_ratio, grown(random)); };
  const auto kind = static_cast<ShapeKind>(random() % 3);
  WorldShape shape = world_shape(body, kind, {length(), length(), length()}, 0.5 + 0.4 * any(random), grown(random));
  if (kind == ShapeKind::capsule && random() % 4 == 0) shape.size[1] = 0;
  return shape;
}

/// Shapes of the world and of bodies in no order; bodies with none, one and several.
inline WorldDescription random_world(const RandomWorld& what, std::mt19937_64& random) {
  std::uniform_real_distribution<double> any(-1, 1);
  WorldDescription world;
  add_floor(world);
  for (Index body = 0; body < what.bodies; ++body) {
    const WorldShape shape = random_shape(body, what.size_ratio, random);
    world.bodies.push_back(solid_body(shape, 1000));
    world.bodies.back().position = {what.spread * any(random), what.spread * any(random), what.spread * any(random)};
    for (double& x : world.bodies.back().twist) x = any(random);
    if (random() % 16 == 0) continue;
    world.shapes.push_back(shape);
    for (std::uint64_t more = random() % 8; more > 5; --more) {
      world.shapes.push_back(random_shape(body, what.size_ratio, random));
      world.shapes.back().position = {0.1 * any(random), 0.1 * any(random), 0.1 * any(random)};
    }
    if (random() % 8 != 0) continue;
    world.shapes.push_back(random_shape(-1, what.size_ratio, random));
    world.shapes.back().position = world.bodies.back().position;
  }
  std::shuffle(world.shapes.begin(), world.shapes.end(), random);
  return world;
}

/// Positions, orientations and twists of its bodies.
template <class Real>
struct Poses {
  std::vector<Real> position, orientation, twist;
};

/// Returns the description's bodies, turned at random; two of them in one place.
template <class Real>
Poses<Real> random_poses(const WorldDescription& world, const RandomWorld& what, std::mt19937_64& random) {
  constexpr double kInf = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();
  std::normal_distribution<double> normal;
  Poses<Real> poses;
  std::array<double, 3> before{};
  for (const WorldBody& body : world.bodies) {
    std::array<double, 3> position = random() % 16 == 0 ? before : body.position;
    std::array<double, 6> twist = body.twist;
    const std::uint64_t fate = what.broken ? random() % 24 : 24;
    if (fate == 0) position[random() % 3] = kNan;
    if (fate == 1) position[random() % 3] = kInf;
    if (fate == 2) position[random() % 3] = -1e30;
    if (fate == 3) twist[random() % 6] = random() % 2 == 0 ? 1e25 : 50;
    if (fate == 4) twist[random() % 6] = random() % 2 == 0 ? kInf : kNan;
    if (fate == 5) position[0] += 1e6;
    before = body.position;
    std::array<double, 4> q{normal(random), normal(random), normal(random), normal(random)};
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (const double x : position) poses.position.push_back(static_cast<Real>(x));
    for (const double x : q) poses.orientation.push_back(static_cast<Real>(x / norm));
    for (const double x : twist) poses.twist.push_back(static_cast<Real>(x));
  }
  return poses;
}

}  // namespace stiction::test
