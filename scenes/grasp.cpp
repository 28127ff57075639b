#include <array>

#include "scenes/catalogue.hpp"
#include "scenes/rows.hpp"

// A hand of fingers with four hinges each (abduction and three flexions) holding a box by its side faces, the palm
// fixed in the world. A finger is laid out from its tip, which touches the box, back to its base. A finger that
// touches is then exact without inverse kinematics.

namespace stiction::scenes {
namespace {

constexpr std::array kBoneLength{0.05, 0.035, 0.03};  // proximal, middle, distal [m]
constexpr std::array kBoneMass{0.04, 0.025, 0.02};    // [kg]
constexpr double kTipRadius = 0.01;                   // [m]
constexpr double kKnuckleMass = 0.03;                 // [kg]
constexpr double kArmature = 2e-5;                    // [kg m^2]
constexpr double kRightAngle = 1.5707963267948966;

struct JointRange {
  double lo, hi;  // [rad]
};
constexpr std::array<JointRange, 4> kRanges{{{-0.3, 0.3}, {-0.2, 1.3}, {0.1, 1.5}, {0.1, 1.5}}};

struct Box {
  Vec3 center, half;
  Mat3 frame;
  Index body;
};

struct Finger {
  std::array<Index, 4> hinge;
  std::array<double, 4> angle;
  Vec3 contact, outward;  ///< touching point; normal of the box's face there
};

Finger add_finger(Rng& rng, Multibody& bodies, const Box& box, int number, double lateral) {
  const std::array outward_of{box.frame.x, -1.0 * box.frame.x, box.frame.y, -1.0 * box.frame.y};
  const auto face = static_cast<std::size_t>(number % 4);
  const double depth = face < 2 ? box.half.x : box.half.y;
  const double width = face < 2 ? box.half.y : box.half.x;
  const Vec3 up{0, 0, 1};
  Finger finger{};
  finger.outward = outward_of[face];
  const Vec3 across = cross(up, finger.outward);
  const double height = rng.uniform(-0.2, 0.5) * box.half.z;
  finger.contact = box.center + depth * finger.outward + (lateral * width) * across + height * up;

  // Elevation of each bone, seen from its far end, above the face's outward direction.
  const double distal = rng.uniform(0.3, 0.6);
  const double middle = distal + rng.uniform(0.15, 0.6);
  const double proximal = middle + rng.uniform(0.15, 0.6);
  const auto bone = [&](double elevation) {
    const auto [s, c] = sin_cos(elevation);
    return c * finger.outward + s * up;
  };
  const std::array direction{bone(proximal), bone(middle), bone(distal)};
  std::array<Vec3, 4> joint;  // base, two knuckles, tip
  joint[3] = finger.contact + kTipRadius * finger.outward;
  for (std::size_t k = 3; k-- > 0;) joint[k] = joint[k + 1] + kBoneLength[k] * direction[k];
  finger.angle = {rng.symmetric(0.3), kRightAngle - proximal, proximal - middle, middle - distal};

  finger.hinge[0] = bodies.add_hinge(kWorld, direction[0], joint[0], rng.symmetric(0.5), kArmature);
  bodies.add_mass(finger.hinge[0], kKnuckleMass, joint[0], world_inertia({}, sphere_inertia(kKnuckleMass, 0.01)));
  for (std::size_t k = 0; k < direction.size(); ++k) {
    const Index parent = finger.hinge[k];
    finger.hinge[k + 1] = bodies.add_hinge(parent, across, joint[k], rng.symmetric(0.5), kArmature);
    bodies.add_mass(finger.hinge[k + 1], kBoneMass[k], 0.5 * (joint[k] + joint[k + 1]),
                    rod_inertia(kBoneMass[k], kBoneLength[k], 0.008, direction[k]));
  }
  const double squeeze = rng.uniform(1, 5);  // [N]
  bodies.add_force_at(finger.hinge.back(), finger.contact, -squeeze * finger.outward);
  return finger;
}

void add_table(Rng& rng, RowWriter& rows, const Box& box) {
  const Index group = rows.new_group();
  for (const auto& [x, y] : {std::array{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
    const Vec3 corner = box.center + box.frame * Vec3{x * box.half.x, y * box.half.y, -box.half.z};
    rows.add_contact({kWorld, box.body, corner, {0, 0, 1}, rng.symmetric(1e-4), 0}, 0.5, group);
  }
}

}  // namespace

SceneEnv make_grasp(Rng& rng, int fingers) {
  Multibody bodies;
  Box box{};
  box.half = {rng.uniform(0.02, 0.04), rng.uniform(0.02, 0.04), rng.uniform(0.03, 0.05)};
  box.center = {0, 0, box.half.z};
  box.frame = rotation_z(rng.symmetric(3));
  const double mass = rng.uniform(0.05, 0.5);
  const Vec3 velocity = random_vector(rng, 0.05);
  box.body = bodies.add_free_body(mass, box.center, world_inertia(box.frame, box_inertia(mass, box.half)), velocity,
                                  random_vector(rng, 0.2));
  std::vector<Finger> hand;
  for (int k = 0; k < fingers; ++k) {
    // A second finger on a face goes beside the first.
    const double side = fingers > 4 ? (k < 4 ? -0.5 : 0.5) : 0;
    hand.push_back(add_finger(rng, bodies, box, k, side + rng.symmetric(0.2)));
  }

  RowWriter rows(bodies);
  for (const Finger& finger : hand) {
    for (const Index hinge : finger.hinge) rows.add_joint_friction(hinge, 0.02);
  }
  for (const Finger& finger : hand)
    for (std::size_t k = 0; k < finger.hinge.size(); ++k)
      rows.add_near_limits(finger.hinge[k], finger.angle[k], kRanges[k].lo, kRanges[k].hi);
  for (const Finger& finger : hand) {
    const double slide = rng.uniform(0.6, 1.2);
    const std::array mu{slide, slide, rng.uniform(0.005, 0.02)};
    const Contact contact{finger.hinge.back(),      box.body, finger.contact, -1.0 * finger.outward,
                          rng.uniform(-5e-4, 1e-4), 0};
    rows.add_contact(contact, mu, rows.new_group());
  }
  if (rng.chance(0.5)) add_table(rng, rows, box);
  return std::move(rows).finish(rng.uniform(1e-3, 1e-2));
}

}  // namespace stiction::scenes
