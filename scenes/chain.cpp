#include "scenes/catalogue.hpp"
#include "scenes/rows.hpp"

// The two chains: bodies on ball joints, and bodies in one-dimensional contact.

namespace stiction::scenes {

SceneEnv make_chain(Rng& rng, int links) {
  constexpr double kLinkLength = 0.1, kRadius = 0.04, kMass = 0.3;  // [m], [m], [kg]
  const int hanging = links / 2;
  Multibody bodies;
  std::vector<Index> body_of;
  std::vector<Vec3> center_of, joint_of;
  // The first joint is nailed to the world, high enough for the last hanging link to end at the beads' height.
  Vec3 joint{0, 0, kRadius + 0.8 * kLinkLength * hanging};
  double heading = 0;
  for (int k = 0; k < links; ++k) {
    Vec3 direction{0.6, 0, -0.8};
    if (k >= hanging) {
      // Steered back towards the x axis so that a long chain keeps its heading.
      heading = 0.9 * heading + rng.symmetric(0.3);
      const auto [s, c] = sin_cos(heading);
      direction = {c, s, 0};
    }
    const Vec3 center = joint + (0.5 * kLinkLength) * direction;
    const double mass = kMass * rng.uniform(0.9, 1.1);
    const Mat3 inertia = world_inertia({}, sphere_inertia(mass, kRadius));
    const Vec3 velocity = random_vector(rng, 0.05);
    body_of.push_back(bodies.add_free_body(mass, center, inertia, velocity, random_vector(rng, 0.2)));
    center_of.push_back(center);
    joint_of.push_back(joint);
    joint = joint + kLinkLength * direction;
  }

  RowWriter rows(bodies);
  for (std::size_t k = 0; k < body_of.size(); ++k) {
    rows.add_ball_joint(k == 0 ? kWorld : body_of[k - 1], body_of[k], joint_of[k]);
  }
  for (auto k = static_cast<std::size_t>(hanging); k < body_of.size(); ++k) {
    // One bead per link: with its joint that is six rows for six degrees of freedom, so A stays regular.
    const Vec3 point = center_of[k] - Vec3{0, 0, kRadius};
    rows.add_contact({kWorld, body_of[k], point, {0, 0, 1}, rng.symmetric(2e-4), 0}, 0.6, rows.new_group());
  }
  return std::move(rows).finish();
}

SceneEnv make_column(Rng& rng, int count) {
  // Velocities are perturbed by a thousandth of g dt only. Every contact stays closed, and a solver needs the n^2 law
  // of the tridiagonal matrix, undisturbed.
  const double perturbation = 1e-3 * kGravity * kTimeStep;
  Multibody bodies;
  for (int k = 0; k < count; ++k) {
    const Index body = bodies.add_slide(kWorld, {0, 0, 1}, rng.symmetric(perturbation));
    bodies.add_mass(body, 1.0, {0, 0, k + 0.5}, {});
  }
  RowWriter rows(bodies);
  for (Index k = 0; k < count; ++k) {
    rows.add_frictionless_contact({k - 1, k, {0, 0, static_cast<double>(k)}, {0, 0, 1}, 0, 0});
  }
  return std::move(rows).finish();
}

SceneEnv make_free_flight(Rng& rng) {
  Multibody bodies;
  const Mat3 inertia = world_inertia(random_rotation(rng), box_inertia(1, {0.1, 0.08, 0.05}));
  const Vec3 velocity = random_vector(rng, 1);
  bodies.add_free_body(1, {0, 0, 1}, inertia, velocity, random_vector(rng, 1));
  return RowWriter(bodies).finish();
}

}  // namespace stiction::scenes
