#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "scenes/worlds.hpp"
#include "stiction/world.hpp"

/// Worlds for tests and readings of them.
namespace stiction::test {

inline WorldShape world_shape(Index body, ShapeKind kind, std::array<double, 3> size, double mu = 0.5, double e = 0) {
  WorldShape shape;
  shape.body = body;
  shape.kind = kind;
  shape.size = size;
  shape.mu = mu;
  shape.restitution = e;
  return shape;
}

/// A body of one shape, added to a world; its density is 1000 kg/m^3. Returns the body, to be put somewhere.
inline WorldBody& add_body(WorldDescription& world, ShapeKind kind, std::array<double, 3> size, double mu = 0.5,
                           double e = 0) {
  const WorldShape shape = world_shape(static_cast<Index>(world.bodies.size()), kind, size, mu, e);
  world.bodies.push_back(solid_body(shape, 1000));
  world.shapes.push_back(shape);
  return world.bodies.back();
}

inline void add_floor(WorldDescription& world, double mu = 0.5) {
  world.shapes.push_back(world_shape(-1, ShapeKind::plane, {0, 0, 0}, mu));
}

template <class Real>
std::array<double, 3> position_of(const World<Real>& world, Offset body) {
  const auto p = world.state().position.subspan(static_cast<std::size_t>(3 * body), 3);
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}
template <class Real>
std::array<double, 6> world_twist(const World<Real>& world, Offset body) {
  std::array<double, 6> twist{};
  for (std::size_t k = 0; k < 6; ++k)
    twist[k] = static_cast<double>(world.state().twist[static_cast<std::size_t>(6 * body) + k]);
  return twist;
}
template <class Real>
double energy_of(const World<Real>& world, std::size_t env = 0) {
  const WorldMotion motion = world.motion()[env];
  return motion.kinetic + motion.potential;
}

/// A world of a scene, environments where the scene begins them.
template <class Real>
World<Real> started(const std::string& name, Offset envs, WorldOptions options = {}, Device device = Device::cpu(),
                    std::uint64_t seed = 0, int size = 0) {
  const scenes::WorldScene scene = scenes::make_world(name, size);
  options.stepping = scene.stepping;
  World<Real> world(device, scene.description, envs, options);
  scenes::start_all(world, name, seed, size);
  return world;
}

template <class Real>
void run(World<Real>& world, int steps) {
  for (int step = 0; step < steps; ++step) world.step();
}

}  // namespace stiction::test
