#include <array>

#include "scenes/catalogue.hpp"
#include "scenes/rows.hpp"

// Trouble that real scenes cause, one kind per environment in turn.

namespace stiction::scenes {
namespace {

constexpr std::array kPowersOfTen{1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6};
constexpr double kHalf = 0.1;  // half edge of the cubes [m]
constexpr Vec3 kUp{0, 0, 1};

Index add_cube(Multibody& bodies, double mass, Vec3 center, Vec3 velocity, Vec3 spin) {
  return bodies.add_free_body(mass, center, world_inertia({}, box_inertia(mass, {kHalf, kHalf, kHalf})), velocity,
                              spin);
}

/// Contacts on a grid of count x count points, at least 2 x 2, over a square face.
void add_grid(RowWriter& rows, Index lower, Index upper, Vec3 center, int count, double mu) {
  const Index group = rows.new_group();
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < count; ++j) {
      const Vec3 offset{(2.0 * i / (count - 1) - 1) * kHalf, (2.0 * j / (count - 1) - 1) * kHalf, 0};
      rows.add_contact({lower, upper, center + offset, kUp, 0, 0}, mu, group);
    }
  }
}

/// Each cube ten times as heavy as the one below, up to a ratio of 10^6.
SceneEnv heavy_on_light(Rng& rng, int size) {
  Multibody bodies;
  std::vector<Index> cubes;
  for (std::size_t k = 0; k < static_cast<std::size_t>(size); ++k) {
    const double mass = kPowersOfTen[k < kPowersOfTen.size() ? k : kPowersOfTen.size() - 1];
    const Vec3 velocity = random_vector(rng, 0.01);
    cubes.push_back(add_cube(bodies, mass, {0, 0, (2 * static_cast<double>(k) + 1) * kHalf}, velocity, {}));
  }
  RowWriter rows(bodies);
  for (std::size_t k = 0; k < cubes.size(); ++k) {
    const Vec3 face{0, 0, 2 * static_cast<double>(k) * kHalf};
    add_grid(rows, k == 0 ? kWorld : cubes[k - 1], cubes[k], face, 2, 0.5);
  }
  return std::move(rows).finish();
}

/// Up to 8 x 8 contacts on one face: rank 6 out of 192 rows.
SceneEnv crowded_face(Rng& rng, int size) {
  Multibody bodies;
  const Vec3 velocity{rng.symmetric(0.5), rng.symmetric(0.5), -rng.uniform(0, 0.1)};
  const Index cube = add_cube(bodies, 1, {0, 0, kHalf}, velocity, random_vector(rng, 1));
  RowWriter rows(bodies);
  add_grid(rows, kWorld, cube, {}, size < 2 ? 2 : size, rng.uniform(0, 2));
  return std::move(rows).finish();
}

/// Cubes with friction from none to 2, different along the two tangents, that stick, slide, lift off or topple.
SceneEnv friction_zoo(Rng& rng, int size) {
  constexpr std::array kMu{0.0, 0.05, 0.5, 1.0, 2.0};
  Multibody bodies;
  std::vector<Index> cubes;
  std::vector<Vec3> centers;
  for (int k = 0; k < size; ++k) {
    constexpr std::array<Vec3, 4> kMotions{{{0, 0, 0}, {3, 1, 0}, {0, 0, 2}, {0, -0.5, -1}}};
    const Vec3 motion = kMotions[static_cast<std::size_t>(rng.below(4))];
    const Vec3 velocity = motion + random_vector(rng, 0.01);
    centers.push_back({3 * k * kHalf, 0, kHalf});
    cubes.push_back(add_cube(bodies, 1, centers.back(), velocity, random_vector(rng, 2)));
  }
  RowWriter rows(bodies);
  for (std::size_t k = 0; k < cubes.size(); ++k) {
    const Index group = rows.new_group();
    for (const auto& [x, y] : {std::array{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
      const double first = kMu[static_cast<std::size_t>(rng.below(5))];
      const std::array mu{first, rng.chance(0.5) ? first : kMu[static_cast<std::size_t>(rng.below(5))]};
      const Contact contact{kWorld, cubes[k], centers[k] + kHalf * Vec3{x, y, -1}, kUp, rng.symmetric(1e-4), 0};
      rows.add_contact(contact, mu, group);
    }
  }
  return std::move(rows).finish();
}

/// Contacts a nanometre to a micrometre apart, their normals nearly equal: nearly singular, not exactly.
SceneEnv twin_contacts(Rng& rng, int size) {
  Multibody bodies;
  const Vec3 velocity{rng.symmetric(0.1), rng.symmetric(0.1), -rng.uniform(0, 0.1)};
  const Index cube = add_cube(bodies, 1, {0, 0, kHalf}, velocity, random_vector(rng, 0.5));
  RowWriter rows(bodies);
  const Index group = rows.new_group();
  for (int k = 0; k < size; ++k) {
    const Vec3 corner{rng.chance(0.5) ? kHalf : -kHalf, rng.chance(0.5) ? kHalf : -kHalf, 0};
    const double apart = 1e-9 * kPowersOfTen[static_cast<std::size_t>(rng.below(4))];
    for (int twin = 0; twin < 2; ++twin) {
      const Vec3 normal = normalized(kUp + random_vector(rng, apart));
      rows.add_contact({kWorld, cube, corner + random_vector(rng, apart), normal, 0, 0}, 0.7, group);
    }
  }
  return std::move(rows).finish();
}

/// Needles of 1 m by 2 mm: principal inertias in a ratio of 10^5, contacts at both ends.
SceneEnv needles(Rng& rng, int size) {
  constexpr Vec3 kNeedle{0.5, 0.001, 0.001};
  Multibody bodies;
  std::vector<Index> all;
  std::vector<Vec3> centers, axes;
  for (int k = 0; k < size; ++k) {
    // Crossed in turn, each lying on the one below.
    const Mat3 frame = rotation_z((k % 2) * 1.2 + rng.symmetric(0.2));
    centers.push_back({rng.symmetric(0.05), rng.symmetric(0.05), (2 * k + 1) * kNeedle.z});
    axes.push_back(frame.x);
    const Vec3 velocity = random_vector(rng, 0.05);
    all.push_back(bodies.add_free_body(0.03, centers.back(), world_inertia(frame, box_inertia(0.03, kNeedle)), velocity,
                                       random_vector(rng, 0.5)));
  }
  RowWriter rows(bodies);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Index group = rows.new_group();
    const Vec3 bottom = centers[k] - kNeedle.z * kUp;
    if (k == 0) {
      for (const double end : {-0.5, 0.5})
        rows.add_contact({kWorld, all[0], bottom + end * axes[0], kUp, 0, 0}, 0.4, group);
      continue;
    }
    // Point at which the two axes cross, seen from above.
    const Vec3 d = centers[k - 1] - centers[k];
    const double along = cross(d, axes[k - 1]).z / cross(axes[k], axes[k - 1]).z;
    rows.add_contact({all[k - 1], all[k], bottom + along * axes[k], kUp, 0, 0}, 0.4, group);
    // A post keeps the far end from falling.
    rows.add_contact({kWorld, all[k], bottom + 0.5 * axes[k], kUp, 0, 0}, 0.4, rows.new_group());
  }
  return std::move(rows).finish();
}

/// Spheres in a steep groove with friction up to 2: wedged, internal forces of any size. No overlap to recover, which
/// a wedged sphere could not: the environment would have no solution.
SceneEnv wedged_spheres(Rng& rng, int size) {
  constexpr double kRadius = 0.05;
  constexpr double kSin = 0.28, kCos = 0.96;  // half angle of the groove, a Pythagorean triple
  Multibody bodies;
  std::vector<Index> all;
  for (int k = 0; k < size; ++k) {
    const double fall = rng.uniform(0, 2);
    const Vec3 velocity = random_vector(rng, 0.1) - fall * kUp;
    const double mass = kPowersOfTen[static_cast<std::size_t>(rng.below(4))];
    all.push_back(bodies.add_free_body(mass, {2 * k * kRadius, 0, 0}, world_inertia({}, sphere_inertia(mass, kRadius)),
                                       velocity, random_vector(rng, 5)));
  }
  RowWriter rows(bodies);
  const double mu = rng.uniform(0.5, 2);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Vec3 center{2 * static_cast<double>(k) * kRadius, 0, 0};
    for (const double side : {-1.0, 1.0}) {
      const Vec3 normal{0, side * kCos, kSin};
      rows.add_contact({kWorld, all[k], center - kRadius * normal, normal, 0, 0}, mu, rows.new_group());
    }
    if (k > 0) {
      const Vec3 between = center - Vec3{kRadius, 0, 0};
      rows.add_contact({all[k - 1], all[k], between, {1, 0, 0}, 0, 0}, mu, rows.new_group());
    }
  }
  return std::move(rows).finish();
}

/// A slab 10^6 times as heavy as each of the spheres that carry it.
SceneEnv slab_on_spheres(Rng& rng, int size) {
  constexpr double kRadius = 0.02;
  const int count = size < 3 ? 3 : size;
  Multibody bodies;
  std::vector<Index> all;
  std::vector<Vec3> centers;
  for (int k = 0; k < count; ++k) {
    centers.push_back({rng.symmetric(kHalf), rng.symmetric(kHalf), kRadius});
    all.push_back(bodies.add_free_body(1e-3, centers.back(), world_inertia({}, sphere_inertia(1e-3, kRadius)), {}, {}));
  }
  const Vec3 velocity = random_vector(rng, 0.2);
  const Index slab = add_cube(bodies, 1e3, {0, 0, 2 * kRadius + kHalf}, velocity, {});
  RowWriter rows(bodies);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Vec3 bottom = centers[k] - kRadius * kUp;
    rows.add_contact({kWorld, all[k], bottom, kUp, 0, 0}, 0.3, rows.new_group());
    rows.add_contact({all[k], slab, centers[k] + kRadius * kUp, kUp, rng.symmetric(1e-5), 0}, 0.3, rows.new_group());
  }
  return std::move(rows).finish();
}

/// Tumbling cubes that hit the ground and each other at up to 50 m/s and bounce.
SceneEnv fast_impacts(Rng& rng, int size) {
  Multibody bodies;
  std::vector<Index> cubes;
  std::vector<Vec3> centers;
  for (int k = 0; k < size; ++k) {
    centers.push_back({rng.symmetric(0.02), rng.symmetric(0.02), (2 * k + 1) * kHalf});
    const double mass = rng.uniform(0.1, 10);
    const Vec3 velocity = random_vector(rng, 50);
    cubes.push_back(add_cube(bodies, mass, centers.back(), velocity, random_vector(rng, 100)));
  }
  RowWriter rows(bodies);
  for (std::size_t k = 0; k < cubes.size(); ++k) {
    const Index group = rows.new_group();
    const double mu = rng.uniform(0, 1), restitution = rng.uniform(0, 1);
    for (int corner = 0; corner < 3; ++corner) {
      const Vec3 offset{rng.symmetric(kHalf), rng.symmetric(kHalf), -kHalf};
      const Vec3 normal = normalized({rng.symmetric(0.3), rng.symmetric(0.3), 1});
      const double gap = rng.symmetric(1e-3);
      rows.add_contact({k == 0 ? kWorld : cubes[k - 1], cubes[k], centers[k] + offset, normal, gap, restitution}, mu,
                       group);
    }
  }
  return std::move(rows).finish();
}

constexpr std::array kKinds{heavy_on_light, crowded_face,   friction_zoo,    twin_contacts,
                            needles,        wedged_spheres, slab_on_spheres, fast_impacts};

}  // namespace

SceneEnv make_adversarial(Rng& rng, std::uint64_t kind, int size) {
  return kKinds[kind % kKinds.size()](rng, size);
}

}  // namespace stiction::scenes
