#include "scenes/worlds.hpp"

#include <array>
#include <cmath>

#include "core/base/fp_env.hpp"
#include "scenes/rng.hpp"
#include "scenes/scenes.hpp"
#include "stiction/error.hpp"

namespace stiction::scenes {
namespace {

using Three = std::array<double, 3>;

WorldShape plane(const Three& position, const std::array<double, 4>& orientation, double mu) {
  WorldShape shape;
  shape.kind = ShapeKind::plane;
  shape.position = position;
  shape.orientation = orientation;
  shape.mu = mu;
  return shape;
}
WorldShape floor_with(double mu) {
  return plane({0, 0, 0}, {1, 0, 0, 0}, mu);
}

/// A body that is one shape of uniform density about its origin; where it begins is the scene's business.
void add_solid(WorldDescription& world, ShapeKind kind, const Three& size, double mu, double restitution = 0,
               double density = 1000) {
  WorldShape shape;
  shape.body = static_cast<Index>(world.bodies.size());
  shape.kind = kind;
  shape.size = size;
  shape.mu = mu;
  shape.restitution = restitution;
  world.bodies.push_back(solid_body(shape, density));
  world.shapes.push_back(shape);
}

/// Gravity where the ground is z = 0 and slopes down along x.
Three gravity_on_slope(double tangent) {
  const double c = 1 / std::sqrt(1 + tangent * tangent);
  return {kGravity * c * tangent, 0, -kGravity * c};
}

void place(WorldStart& start, const Three& position, const std::array<double, 4>& orientation,
           const std::array<double, 6>& twist) {
  for (const double value : position) start.position.push_back(value);
  for (const double value : orientation) start.orientation.push_back(value);
  for (const double value : twist) start.twist.push_back(value);
}

/// Every orientation is as likely: a point of the unit ball of four dimensions, pushed out to its surface.
std::array<double, 4> any_orientation(Rng& rng) {
  for (;;) {
    std::array<double, 4> q{};
    double square = 0;
    for (double& x : q) {
      x = rng.symmetric(1);
      square += x * x;
    }
    if (square > 1 || square < 0.01) continue;
    for (double& x : q) x /= std::sqrt(square);
    return q;
  }
}

// pile: bodies of three shapes fall into an open bin.

constexpr int kHeapBodies = 12;

/// Bodies of a layer lie in a square: about as many on a side as there are layers.
int heap_side(int size) {
  int side = 2;
  while ((side + 1) * (side + 1) * (side + 1) <= size) ++side;
  return side;
}

WorldDescription make_heap(int size) {
  const double half = std::sqrt(0.5);
  const double bin = 0.175 * heap_side(size);
  WorldDescription world;
  world.shapes.push_back(floor_with(0.6));
  world.shapes.push_back(plane({-bin, 0, 0}, {half, 0, half, 0}, 0.3));
  world.shapes.push_back(plane({bin, 0, 0}, {half, 0, -half, 0}, 0.3));
  world.shapes.push_back(plane({0, -bin, 0}, {half, -half, 0, 0}, 0.3));
  world.shapes.push_back(plane({0, bin, 0}, {half, half, 0, 0}, 0.3));
  for (int k = 0; k < size; ++k) {
    const double grown = 1 + 0.1 * (k / 3 % 4);
    if (k % 3 == 0) {
      add_solid(world, ShapeKind::sphere, {0.08 * grown, 0, 0}, 0.5, 0.1);
    } else if (k % 3 == 1) {
      add_solid(world, ShapeKind::capsule, {0.05 * grown, 0.08 * grown, 0}, 0.5, 0.1);
    } else {
      add_solid(world, ShapeKind::box, {0.09 * grown, 0.07 * grown, 0.05 * grown}, 0.5, 0.1);
    }
  }
  return world;
}

WorldStart start_heap(Rng& rng, int size) {
  constexpr double kPitch = 0.34;
  const int side = heap_side(size);
  const double middle = 0.5 * (side - 1);
  WorldStart start;
  for (int k = 0; k < size; ++k) {
    const double x = kPitch * (k % side - middle) + rng.symmetric(0.01);
    const double y = kPitch * (k / side % side - middle) + rng.symmetric(0.01);
    const int layer = k / (side * side);
    const double z = 0.2 + kPitch * layer + rng.symmetric(0.01);
    const std::array<double, 4> orientation = any_orientation(rng);
    std::array<double, 6> twist{};
    for (int j = 0; j < 6; ++j) twist[static_cast<std::size_t>(j)] = rng.symmetric(j < 3 ? 0.2 : 2);
    place(start, {x, y, z}, orientation, twist);
  }
  return start;
}

// walker: a rimless wheel, its feet capsules across, so that it cannot fall sideways.

/// Cosine and sine of half the angle between two spokes, 22.5 degrees.
const double kHalfCos = std::sqrt((1 + std::sqrt(0.5)) / 2);
const double kHalfSin = std::sqrt((1 - std::sqrt(0.5)) / 2);
constexpr double kWheelMass = 1;

WorldDescription make_wheel(int) {
  using Wheel = RimlessWheel;
  const double half = std::sqrt(0.5);
  const double spoke = Wheel::kLength - Wheel::kFootRadius;
  WorldDescription world;
  world.gravity = gravity_on_slope(Wheel::kSlope);
  world.shapes.push_back(floor_with(4));
  const double about_axle = kWheelMass * Wheel::kGyration * Wheel::kLength * Wheel::kLength;
  WorldBody hub;
  hub.mass = kWheelMass;
  hub.inertia = {0.75 * about_axle, about_axle, 0.75 * about_axle};
  hub.position = {0, 0, spoke * kHalfCos + Wheel::kFootRadius};
  world.bodies.push_back(hub);
  // Two spokes point down at 22.5 degrees to either side, the others follow every 45.
  double x = kHalfSin;
  double z = -kHalfCos;
  for (int k = 0; k < Wheel::kSpokes; ++k) {
    WorldShape foot;
    foot.body = 0;
    foot.kind = ShapeKind::capsule;
    foot.size = {Wheel::kFootRadius, 0.3, 0};
    foot.position = {spoke * x, 0, spoke * z};
    foot.orientation = {half, half, 0, 0};
    foot.mu = 4;
    world.shapes.push_back(foot);
    const double turned = half * (x + z);
    z = half * (z - x);
    x = turned;
  }
  return world;
}

WorldStart start_wheel(Rng& rng, int) {
  using Wheel = RimlessWheel;
  const double spin = rng.uniform(1.2, 2.0);
  const double spoke = Wheel::kLength - Wheel::kFootRadius;
  WorldStart start;
  // About the front foot, as if the one behind had just left the ground.
  place(start, {0, 0, spoke * kHalfCos + Wheel::kFootRadius}, {1, 0, 0, 0},
        {spin * (spoke * kHalfCos + Wheel::kFootRadius), 0, spin * spoke * kHalfSin, 0, spin, 0});
  return start;
}

// stack: boxes, each a little off the one below.

constexpr int kStackBoxes = 5;
constexpr double kBoxHalf = 0.1;

WorldDescription make_tower(int size) {
  WorldDescription world;
  world.shapes.push_back(floor_with(0.5));
  for (int k = 0; k < size; ++k) add_solid(world, ShapeKind::box, {kBoxHalf, kBoxHalf, kBoxHalf}, 0.5);
  return world;
}

WorldStart start_tower(Rng& rng, int size) {
  WorldStart start;
  for (int k = 0; k < size; ++k) {
    const double x = rng.symmetric(0.01);
    const double y = rng.symmetric(0.01);
    place(start, {x, y, (2 * k + 1) * kBoxHalf + 1e-4 * (k + 1)}, {1, 0, 0, 0}, {});
  }
  return start;
}

// bounce: three balls of different restitution.

constexpr std::array<double, 3> kRestitutions{0.3, 0.6, 0.9};
constexpr double kBallRadius = 0.1;

WorldDescription make_balls(int) {
  WorldDescription world;
  world.shapes.push_back(floor_with(0.5));
  for (const double restitution : kRestitutions)
    add_solid(world, ShapeKind::sphere, {kBallRadius, 0, 0}, 0.5, restitution);
  return world;
}

WorldStart start_balls(Rng& rng, int) {
  WorldStart start;
  for (int k = 0; k < static_cast<int>(kRestitutions.size()); ++k)
    place(start, {0.5 * k, 0, kBallRadius + rng.uniform(0.5, 1.0)}, {1, 0, 0, 0}, {});
  return start;
}

// slide: two blocks on a slope between their two frictions.

constexpr double kSlideSlope = 0.3;
constexpr std::array<double, 2> kSlideFrictions{0.2, 0.5};

WorldDescription make_slope(int) {
  WorldDescription world;
  world.gravity = gravity_on_slope(kSlideSlope);
  world.shapes.push_back(floor_with(1));
  // A pair has the root of the product.
  for (const double mu : kSlideFrictions) add_solid(world, ShapeKind::box, {0.15, 0.1, 0.05}, mu * mu);
  return world;
}

WorldStart start_slope(Rng& rng, int) {
  WorldStart start;
  const double speed = rng.uniform(0.5, 2.0);
  for (int k = 0; k < 2; ++k) place(start, {0, 0.5 * k, 0.05}, {1, 0, 0, 0}, {speed, 0, 0, 0, 0, 0});
  return start;
}

struct Recipe {
  const char* name;
  const char* summary;
  WorldDescription (*describe)(int size);
  WorldStart (*start)(Rng& rng, int size);
  double dt;
  int size;  ///< bodies unless another size is chosen; 0: it cannot be
};

const std::array kRecipes{
    Recipe{"pile", "12 spheres, capsules and boxes fall into a bin", make_heap, start_heap, 0.005, kHeapBodies},
    Recipe{"walker", "a rimless wheel of 8 spokes walks down a slope", make_wheel, start_wheel, 0.002, 0},
    Recipe{"stack", "5 boxes on top of each other", make_tower, start_tower, 0.005, kStackBoxes},
    Recipe{"bounce", "3 balls of restitution 0.3, 0.6, 0.9", make_balls, start_balls, 0.001, 0},
    Recipe{"slide", "2 blocks on a slope of 0.3 with friction 0.2 and 0.5", make_slope, start_slope, 0.005, 0},
};

const Recipe& find(const std::string& name) {
  std::string names;
  for (const Recipe& recipe : kRecipes) {
    if (name == recipe.name) return recipe;
    names += (names.empty() ? "" : ", ") + std::string(recipe.name);
  }
  throw Error(ErrorCode::invalid_argument, "scene '" + name + "' cannot be stepped: choose one of " + names);
}

/// Bodies of a scene that was asked for with a size.
int size_of(const Recipe& recipe, int size) {
  if (size == 0) return recipe.size;
  if (recipe.size == 0)
    throw Error(ErrorCode::invalid_argument,
                std::string("scene '") + recipe.name + "' has no size: leave it out, or choose pile or stack");
  if (size < 0) throw Error(ErrorCode::invalid_argument, "size = " + std::to_string(size) + ": must be at least 1");
  return size;
}

std::uint64_t stream_key(const std::string& name, std::uint64_t seed, std::uint64_t index) {
  std::uint64_t key = 0;
  for (const char c : name) key = mix_bits(key + static_cast<unsigned char>(c));
  return mix_bits(mix_bits(key ^ seed) + index);
}

}  // namespace

std::vector<std::string> world_names() {
  std::vector<std::string> names;
  for (const Recipe& recipe : kRecipes) names.emplace_back(recipe.name);
  return names;
}

WorldScene make_world(const std::string& name, int size) {
  const ScopedFpEnv fp_env;
  const Recipe& recipe = find(name);
  const int bodies = size_of(recipe, size);
  WorldScene scene{recipe.name, recipe.summary, recipe.describe(bodies), {}, bodies};
  scene.stepping.dt = recipe.dt;
  return scene;
}

WorldStart start_world(const std::string& name, std::uint64_t seed, std::uint64_t index, int size) {
  const ScopedFpEnv fp_env;
  const Recipe& recipe = find(name);
  Rng rng(stream_key(name, seed, index));
  return recipe.start(rng, size_of(recipe, size));
}

template <class Real>
void start_all(World<Real>& world, const std::string& name, std::uint64_t seed, int size) {
  const ScopedFpEnv fp_env;
  std::vector<Real> position, orientation, twist;
  const auto append = [](std::vector<Real>& to, const std::vector<double>& from) {
    for (const double value : from) to.push_back(static_cast<Real>(value));
  };
  for (Offset env = 0; env < world.env_count(); ++env) {
    const WorldStart start = start_world(name, seed, static_cast<std::uint64_t>(env), size);
    append(position, start.position);
    append(orientation, start.orientation);
    append(twist, start.twist);
  }
  const std::vector<std::uint8_t> all(static_cast<std::size_t>(world.env_count()), 1);
  world.reset(all, WorldState<Real>{position, orientation, twist});
}

template void start_all(World<float>&, const std::string&, std::uint64_t, int);
template void start_all(World<double>&, const std::string&, std::uint64_t, int);

}  // namespace stiction::scenes
