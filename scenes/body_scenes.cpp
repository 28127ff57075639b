#include "scenes/body_scenes.hpp"

#include <algorithm>

#include "core/base/fp_env.hpp"
#include "scenes/geometry.hpp"
#include "scenes/scenes.hpp"

namespace stiction::scenes {
namespace {

constexpr double kRadius = 0.05;            // [m]
constexpr double kDensity = 1000;           // [kg/m^3]
constexpr double kTouching = 5e-4;          // pairs nearer than this have a contact [m]
constexpr double kContactsPerSphere = 3.3;  // result of the shaken packing
// Random numbers that a sphere takes, and then a body.
constexpr std::uint64_t kBallNumbers = 4, kBodyNumbers = 6;

std::array<double, 3> as_array(Vec3 v) {
  return {v.x, v.y, v.z};
}

std::array<double, 6> inverse(const Mat3& inertia) {
  // Symmetric: the adjugate's columns are cross products of the matrix's.
  const Vec3 yz = cross(inertia.y, inertia.z);
  const double scale = 1 / dot(inertia.x, yz);
  const Vec3 zx = cross(inertia.z, inertia.x);
  const Vec3 xy = cross(inertia.x, inertia.y);
  return {scale * yz.x, scale * yz.y, scale * yz.z, scale * zx.y, scale * zx.z, scale * xy.z};
}

BodyEnvironment<double>::Body make_body(Rng& rng, double mass, const Mat3& inertia) {
  BodyEnvironment<double>::Body body;
  body.inv_mass = 1 / mass;
  body.inv_inertia = inverse(inertia);
  const Vec3 velocity = random_vector(rng, 0.05);
  const Vec3 spin = random_vector(rng, 0.5);
  body.twist = {velocity.x, velocity.y, velocity.z, spin.x, spin.y, spin.z};
  body.twist_change = {0, 0, -kTimeStep * kGravity, 0, 0, 0};
  return body;
}

BodyEnvironment<double>::Contact make_contact(Index a, Index b, Vec3 arm_a, Vec3 arm_b, Vec3 normal, double mu) {
  BodyEnvironment<double>::Contact contact;
  contact.body_a = a;
  contact.body_b = b;
  contact.arm_a = as_array(arm_a);
  contact.arm_b = as_array(arm_b);
  contact.normal = as_array(normal);
  contact.mu = mu;
  return contact;
}

struct Ball {
  Vec3 center;
  double radius;
};

/// Cells of a packing, and along the vertical.
struct Extent {
  Index side = 1, layers = 1;
};

/// A cube, or less than one, with about that many contacts.
Extent heap_of(Index contacts) {
  const double spheres = contacts / kContactsPerSphere;
  Extent heap;
  while (4.0 * heap.side * heap.side * heap.side < spheres) ++heap.side;
  heap.layers = heap.side;
  while (heap.layers > 1 && 4.0 * heap.side * heap.side * (heap.layers - 1) >= spheres) --heap.layers;
  return heap;
}

/// Cubic cells with four spheres each, a face-centred cubic packing, shaken. Spheres of a cell and of its neighbours
/// are the only ones that can touch, so the lattice is the grid that finds pairs.
class Packing {
 public:
  /// Layers first .. end - 1 of the packing whose first number is the generator's next.
  Packing(Rng rng, const Extent& extent, Index first, Index end) : side_(extent.side), first_(first), end_(end) {
    constexpr double kShift[4][3] = {{0.25, 0.25, 0.25}, {0.75, 0.75, 0.25}, {0.75, 0.25, 0.75}, {0.25, 0.75, 0.75}};
    rng.skip(kBallNumbers * static_cast<std::uint64_t>(begin()));
    for (Index z = first_; z < end_; ++z)
      for (Index y = 0; y < side_; ++y)
        for (Index x = 0; x < side_; ++x)
          for (const auto& shift : kShift) {
            const double radius = kRadius * rng.uniform(0.98, 1.02);
            const Vec3 shake = random_vector(rng, 0.06 * kRadius);
            balls_.push_back(
                {Vec3{kCell * (x + shift[0]), kCell * (y + shift[1]), kCell * (z + shift[2])} + shake, radius});
          }
  }

  [[nodiscard]] const Ball& ball(Index k) const { return balls_[static_cast<std::size_t>(k - begin())]; }

  /// f(plane normal, gap) for each wall that touches a ball.
  template <class F>
  void for_each_wall(const Ball& ball, F&& f) const {
    const double width = kCell * side_ - 0.5 * kRadius;
    const double left = 0.5 * kRadius;
    const auto see = [&](Vec3 normal, double distance) {
      if (distance - ball.radius < kTouching) f(normal, distance - ball.radius);
    };
    see({0, 0, 1}, ball.center.z - left);
    see({1, 0, 0}, ball.center.x - left);
    see({-1, 0, 0}, width - ball.center.x);
    see({0, 1, 0}, ball.center.y - left);
    see({0, -1, 0}, width - ball.center.y);
  }

  /// f(a, b) for every pair of these layers that touches, a < b, by a.
  template <class F>
  void for_each_pair(F&& f) const {
    for (Index z = first_; z < end_; ++z)
      for (Index y = 0; y < side_; ++y)
        for (Index x = 0; x < side_; ++x)
          for (Index own = 0; own < 4; ++own) {
            const Index a = cell(x, y, z) * 4 + own;
            for (Index dz = -1; dz <= 1; ++dz)
              for (Index dy = -1; dy <= 1; ++dy)
                for (Index dx = -1; dx <= 1; ++dx) {
                  if (!inside(x + dx, side_) || !inside(y + dy, side_) || z + dz < first_ || z + dz >= end_) continue;
                  const Index other = cell(x + dx, y + dy, z + dz) * 4;
                  for (Index b = other; b < other + 4; ++b)
                    if (b > a && touch(ball(a), ball(b))) f(a, b);
                }
          }
  }

 private:
  // Neighbours of the packing are kCell / sqrt(2) apart: one radius-and-a-bit each.
  static constexpr double kCell = 2.0 * kRadius * 1.4142135623730951;

  static bool inside(Index i, Index count) { return i >= 0 && i < count; }
  [[nodiscard]] Index cell(Index x, Index y, Index z) const { return (z * side_ + y) * side_ + x; }
  static bool touch(const Ball& a, const Ball& b) {
    const Vec3 d = b.center - a.center;
    const double reach = a.radius + b.radius + kTouching;
    return dot(d, d) < reach * reach;
  }

  [[nodiscard]] Index begin() const { return 4 * side_ * side_ * first_; }

  Index side_, first_, end_;
  std::vector<Ball> balls_;
};

double gap_depth(double gap) {
  return gap > 0 ? -gap : 0;
}

template <class To, class From>
BodyEnvironment<To> converted(const BodyEnvironment<From>& from) {
  const auto all = [](const auto& source, auto& target) {
    for (std::size_t i = 0; i < source.size(); ++i) target[i] = static_cast<To>(source[i]);
  };
  BodyEnvironment<To> to;
  for (const auto& source : from.bodies) {
    auto& body = to.bodies.emplace_back();
    body.inv_mass = static_cast<To>(source.inv_mass);
    all(source.inv_inertia, body.inv_inertia);
    all(source.twist, body.twist);
    all(source.twist_change, body.twist_change);
    body.kinematic = source.kinematic;
  }
  for (const auto& source : from.contacts) {
    auto& contact = to.contacts.emplace_back();
    contact.body_a = source.body_a;
    contact.body_b = source.body_b;
    all(source.arm_a, contact.arm_a);
    all(source.arm_b, contact.arm_b);
    all(source.normal, contact.normal);
    contact.mu = static_cast<To>(source.mu);
    contact.depth = static_cast<To>(source.depth);
    contact.restitution = static_cast<To>(source.restitution);
    contact.id = source.id;
  }
  return to;
}

}  // namespace

namespace {

Offset bodies_of(const Extent& extent) {
  return Offset{4} * extent.side * extent.side * extent.layers;
}

/// Bodies first .. end - 1. The others are those that touch them, in their layers or next to them.
BodyPart make_packing(std::uint64_t seed, const Extent& extent, Index first, Index end) {
  const ScopedFpEnv fp_env;
  Rng rng(mix_bits(seed) ^ 0x70696c65U);
  const Index in_layer = 4 * extent.side * extent.side;
  const Index low = std::max((first / in_layer) - 1, 0), high = std::min((end - 1) / in_layer + 2, extent.layers);
  const Packing packing(rng, extent, low, high);
  const auto is_asked = [&](Index k) { return first <= k && k < end; };
  BodyPart part;
  std::vector<Index> place(static_cast<std::size_t>(in_layer * (high - low)), -1);  // by body of these layers
  const auto place_of = [&](Index k) -> Index& { return place[static_cast<std::size_t>(k - in_layer * low)]; };
  for (Index k = first; k < end; ++k) place_of(k) = 0;
  if (end - first < bodies_of(extent))
    packing.for_each_pair([&](Index i, Index j) {
      if (is_asked(i) || is_asked(j)) place_of(i) = place_of(j) = 0;
    });
  rng.skip(kBallNumbers * static_cast<std::uint64_t>(bodies_of(extent)));
  for (Index k = in_layer * low; k < in_layer * high; ++k) {
    if (place_of(k) < 0) continue;
    place_of(k) = static_cast<Index>(part.body.size());
    part.body.push_back(k);
    Rng own = rng;
    own.skip(kBodyNumbers * static_cast<std::uint64_t>(k));
    const double radius = packing.ball(k).radius;
    const double mass = kDensity * 4.1887902047863905 * radius * radius * radius;
    part.environment.bodies.push_back(make_body(own, mass, world_inertia({}, sphere_inertia(mass, radius))));
  }
  rng.skip(kBodyNumbers * static_cast<std::uint64_t>(bodies_of(extent)));
  const double mu = rng.uniform(0.3, 0.8);
  auto& contacts = part.environment.contacts;
  const auto add = [&](BodyEnvironment<double>::Contact contact, double gap) {
    contact.depth = gap_depth(gap);
    contact.id = contacts.size();
    contacts.push_back(contact);
  };
  for (Index k = first; k < end; ++k) {
    const Ball& ball = packing.ball(k);
    packing.for_each_wall(ball, [&](Vec3 normal, double gap) {
      const double reach = gap > 0 ? ball.radius : ball.radius + gap;
      add(make_contact(-1, place_of(k), {}, -reach * normal, normal, mu), gap);
    });
  }
  part.walls = static_cast<Index>(contacts.size());
  packing.for_each_pair([&](Index i, Index j) {
    if (!is_asked(i) && !is_asked(j)) return;
    part.pairs_below += is_asked(i) ? 0 : 1;
    const Ball& a = packing.ball(i);
    const Ball& b = packing.ball(j);
    const Vec3 d = b.center - a.center;
    const double distance = norm(d);
    const Vec3 normal = (1 / distance) * d;
    const double gap = distance - (a.radius + b.radius);
    const double reach = a.radius + 0.5 * gap;
    add(make_contact(place_of(i), place_of(j), reach * normal, (reach - distance) * normal, normal, mu), gap);
  });
  return part;
}

BodyEnvironment<double> make_packing(std::uint64_t seed, const Extent& extent) {
  return make_packing(seed, extent, 0, static_cast<Index>(bodies_of(extent))).environment;
}

}  // namespace

BodyEnvironment<double> make_body_pile(std::uint64_t seed, Index contacts) {
  return make_packing(seed, heap_of(contacts));
}

BodyEnvironment<double> make_body_column(std::uint64_t seed, Index side, Index layers) {
  return make_packing(seed, {side, layers});
}

Offset column_bodies(Index side, Index layers) {
  return bodies_of({side, layers});
}

BodyPart make_body_column_part(std::uint64_t seed, Index side, Index layers, Index first, Index end) {
  return make_packing(seed, {side, layers}, first, end);
}

BodyEnvironment<double> make_body_stack(std::uint64_t seed, Index boxes) {
  const ScopedFpEnv fp_env;
  Rng rng(mix_bits(seed) ^ 0x737461636bU);
  BodyEnvironment<double> env;
  BodyEnvironment<double>::Body floor;
  floor.kinematic = true;
  floor.twist = {0.1, 0, 0, 0, 0, 0.2};
  env.bodies.push_back(floor);
  double top_of_last = 0;  // from the centre of the body below to its upper face
  for (Index k = 0; k < boxes; ++k) {
    const double x = rng.uniform(0.08, 0.12);
    const double y = rng.uniform(0.08, 0.12);
    const Vec3 half{x, y, rng.uniform(0.05, 0.1)};
    const double mass = 8 * kDensity * half.x * half.y * half.z;
    env.bodies.push_back(make_body(rng, mass, world_inertia({}, box_inertia(mass, half))));
    const double depth = rng.uniform(-2e-4, 2e-4);
    for (const double side_x : {-0.08, 0.08})
      for (const double side_y : {-0.08, 0.08}) {
        auto contact = make_contact(k, k + 1, {side_x, side_y, top_of_last}, {side_x, side_y, -half.z}, {0, 0, 1}, 0.6);
        contact.depth = depth;
        contact.id = env.contacts.size();
        env.contacts.push_back(contact);
      }
    top_of_last = half.z;
  }
  return env;
}

BodyEnvironment<float> rounded(const BodyEnvironment<double>& environment) {
  return converted<float>(environment);
}

BodyEnvironment<double> widened(const BodyEnvironment<float>& environment) {
  return converted<double>(environment);
}

}  // namespace stiction::scenes
