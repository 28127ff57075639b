#include <array>

#include "scenes/catalogue.hpp"
#include "scenes/rows.hpp"

// A robot with a floating trunk and legs of three hinges (abduction, hip, knee) on rough ground. It has the masses and
// lengths of a 13 kg quadruped.

namespace stiction::scenes {
namespace {

constexpr double kTrunkMass = 6.0;                                   // [kg]
constexpr Vec3 kTrunkHalf{0.19, 0.05, 0.055};                        // [m]
constexpr double kHipMass = 0.6, kThighMass = 0.9, kShinMass = 0.2;  // [kg]
constexpr double kHipOffset = 0.08, kLegLength = 0.213;              // [m]
constexpr double kFootRadius = 0.02;                                 // [m]
constexpr double kArmature = 0.005;                                  // [kg m^2]
constexpr double kJointFriction = 0.3;                               // [N m]

struct JointRange {
  double lo, hi, rest;  // [rad]
};
constexpr std::array<JointRange, 3> kJoints{{{-0.86, 0.86, 0.0}, {-0.69, 2.5, 0.8}, {-2.7, -0.88, -1.5}}};

struct Leg {
  std::array<Index, 3> hinge;
  std::array<double, 3> angle;
  Vec3 foot;
};

/// Angle of a joint: mostly around the pose of rest, now and then driven into a limit.
double draw_angle(Rng& rng, const JointRange& range) {
  if (rng.chance(0.15)) return range.lo + rng.uniform(-0.01, 0.05);
  return range.rest + rng.symmetric(0.35);
}

Leg add_leg(Rng& rng, Multibody& bodies, Index trunk, Vec3 hip, const Mat3& trunk_frame, double side) {
  Leg leg{};
  for (std::size_t k = 0; k < leg.angle.size(); ++k) leg.angle[k] = draw_angle(rng, kJoints[k]);
  const Mat3 hip_frame = trunk_frame * rotation_x(leg.angle[0]);
  const Mat3 thigh_frame = hip_frame * rotation_y(leg.angle[1]);
  const Mat3 shin_frame = thigh_frame * rotation_y(leg.angle[2]);
  const Vec3 thigh_top = hip + (side * kHipOffset) * hip_frame.y;
  const Vec3 knee = thigh_top - kLegLength * thigh_frame.z;
  leg.foot = knee - kLegLength * shin_frame.z;

  leg.hinge[0] = bodies.add_hinge(trunk, trunk_frame.x, hip, rng.symmetric(0.5), kArmature);
  leg.hinge[1] = bodies.add_hinge(leg.hinge[0], hip_frame.y, thigh_top, rng.symmetric(1), kArmature);
  leg.hinge[2] = bodies.add_hinge(leg.hinge[1], hip_frame.y, knee, rng.symmetric(1), kArmature);

  const Mat3 motor = world_inertia(hip_frame, {5e-4, 9e-4, 6e-4});
  bodies.add_mass(leg.hinge[0], kHipMass, hip + (0.5 * side * kHipOffset) * hip_frame.y, motor);
  bodies.add_mass(leg.hinge[1], kThighMass, 0.5 * (thigh_top + knee),
                  rod_inertia(kThighMass, kLegLength, 0.02, thigh_frame.z));
  bodies.add_mass(leg.hinge[2], kShinMass, 0.5 * (knee + leg.foot),
                  rod_inertia(kShinMass, kLegLength, 0.01, shin_frame.z));
  return leg;
}

/// A servo around the pose of rest.
void add_servo(Multibody& bodies, const Leg& leg) {
  constexpr double kStiffness = 20, kDamping = 0.5;  // [N m/rad], [N m s/rad]
  for (std::size_t k = 0; k < leg.hinge.size(); ++k) {
    const double velocity = bodies.dofs()[static_cast<std::size_t>(leg.hinge[k])].velocity;
    bodies.add_force(leg.hinge[k], kStiffness * (kJoints[k].rest - leg.angle[k]) - kDamping * velocity);
  }
}

}  // namespace

SceneEnv make_walker(Rng& rng, int legs) {
  Multibody bodies;
  const Vec3 tilt = random_vector(rng, 0.08);
  const Mat3 frame = rotation_z(rng.symmetric(3)) * rotation_of(1, tilt);
  const Vec3 velocity{rng.symmetric(0.5), rng.symmetric(0.5), rng.symmetric(0.2)};
  const Vec3 center{0, 0, 0.3};
  const Index trunk = bodies.add_free_body(
      kTrunkMass, center, world_inertia(frame, box_inertia(kTrunkMass, kTrunkHalf)), velocity, random_vector(rng, 0.5));
  std::vector<Leg> all;
  for (int k = 0; k < legs; ++k) {
    const double side = k % 2 == 0 ? 1 : -1;
    const int pair = k / 2, pairs = (legs + 1) / 2;
    const double along = pairs > 1 ? 1 - 2.0 * pair / (pairs - 1) : 0;
    const Vec3 hip = center + frame * Vec3{along * kTrunkHalf.x, side * kTrunkHalf.y, 0};
    all.push_back(add_leg(rng, bodies, trunk, hip, frame, side));
  }
  for (const Leg& leg : all) add_servo(bodies, leg);

  RowWriter rows(bodies);
  for (const Leg& leg : all) {
    for (const Index hinge : leg.hinge) rows.add_joint_friction(hinge, kJointFriction);
  }
  for (const Leg& leg : all)
    for (std::size_t k = 0; k < leg.hinge.size(); ++k)
      rows.add_near_limits(leg.hinge[k], leg.angle[k], kJoints[k].lo, kJoints[k].hi);
  for (const Leg& leg : all) {
    // Rough ground: under a standing foot the ground is where the foot is, and tilted a little.
    if (!rng.chance(0.8)) continue;
    const Vec3 normal = normalized({rng.symmetric(0.2), rng.symmetric(0.2), 1});
    const Vec3 point = leg.foot - kFootRadius * normal;
    const double gap = rng.uniform(-2e-3, 1e-3);
    rows.add_contact({kWorld, leg.hinge[2], point, normal, gap, 0}, rng.uniform(0.4, 1.0), rows.new_group());
  }
  return std::move(rows).finish(rng.uniform(1e-3, 1e-2));
}

}  // namespace stiction::scenes
