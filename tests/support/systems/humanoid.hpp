#pragma once

#include <initializer_list>

#include "stiction/articulated.hpp"

namespace stiction::test {

/// A body of 27 degrees of freedom, about as large as Gymnasium's humanoid. Waist, hips, knees, ankles, shoulders and
/// elbows are limited hinges with motors. Feet, shins, thighs, hands, trunk and pelvis touch a plane, and
/// legs each other.
class Humanoid {
 public:
  using Three = std::array<double, 3>;

  static ArticulatedDescription make() {
    Humanoid one;
    one.add_trunk();
    for (const double side : {-1.0, 1.0}) one.add_leg(side);
    for (const double side : {-1.0, 1.0}) one.add_arm(side);
    one.add_pairs();
    return one.model_;
  }

 private:
  struct Hinge {
    Three axis;
    double low, high, gear;
  };

  Index add_body(Index parent, Three position, double mass, std::initializer_list<Hinge> hinges) {
    constexpr double kInfinite = __builtin_huge_val();
    const double inertia = 0.01 * mass;
    model_.bodies.push_back({parent,
                             static_cast<Index>(hinges.size()),
                             position,
                             {1, 0, 0, 0},
                             mass,
                             {0, 0, -0.1},
                             {1, 0, 0, 0},
                             {inertia, inertia, 0.5 * inertia},
                             {1 / mass, 20}});
    for (const Hinge& hinge : hinges) {
      ArticulatedJoint joint;
      joint.axis = hinge.axis;
      joint.stiffness = 2;
      joint.is_limited = true;
      joint.range = {hinge.low, hinge.high};
      model_.actuators.push_back(
          {static_cast<Index>(model_.joints.size()), hinge.gear, {1, 0, 0}, {}, {-0.4, 0.4}, {-kInfinite, kInfinite}});
      model_.joints.push_back(joint);
      model_.dofs.push_back({.02, 1, 0, {}, 15});
    }
    return static_cast<Index>(model_.bodies.size()) - 1;
  }
  void add_geom(Index body, GeomKind kind, Three size, Three position, bool lies = false) {
    touching_.push_back(static_cast<Index>(model_.geoms.size()));
    if (lies)
      model_.geoms.push_back({body, kind, size, position, {kHalf, 0, kHalf, 0}});
    else
      model_.geoms.push_back({body, kind, size, position, {1, 0, 0, 0}});
  }

  void add_trunk() {
    model_.timestep = 0.005;
    model_.bodies.push_back({});
    model_.geoms.push_back({0, GeomKind::plane, {}, {}, {1, 0, 0, 0}});
    model_.bodies.push_back({0, 1, {0, 0, 1.3}, {1, 0, 0, 0}, 9, {0, 0, .05}, {1, 0, 0, 0}, {.15, .15, .06}, {.1, 5}});
    model_.joints.push_back({});
    model_.joints.back().kind = JointKind::free;
    model_.dofs.resize(6);
    add_geom(1, GeomKind::sphere, {.11}, {0, 0, .19});
    const Index waist = add_body(1, {0, 0, -.26}, 2.2, {{{0, 0, 1}, -.8, .8, 40}, {{0, 1, 0}, -1.3, .5, 40}});
    pelvis_ = add_body(waist, {0, 0, -.17}, 6.5, {{{1, 0, 0}, -.6, .6, 40}});
    add_geom(pelvis_, GeomKind::sphere, {.13}, {-.02, 0, -.02});
  }
  void add_leg(double side) {
    const Index thigh = add_body(pelvis_, {0, .1 * side, -.04}, 4.5,
                                 {{{1, 0, 0}, -.5, .5, 40}, {{0, 0, 1}, -1, .6, 40}, {{0, 1, 0}, -1.9, .4, 120}}),
                shin = add_body(thigh, {0, .01 * side, -.4}, 2.6, {{{0, -1, 0}, -2.7, .03, 80}}),
                foot = add_body(shin, {0, 0, -.39}, 1.2, {{{0, 1, 0}, -.9, .9, 20}, {{1, 0, 0}, -.9, .9, 20}});
    thigh_[side > 0 ? 1 : 0] = static_cast<Index>(model_.geoms.size());
    add_geom(thigh, GeomKind::capsule, {.06, .17}, {0, 0, -.17});
    shin_[side > 0 ? 1 : 0] = static_cast<Index>(model_.geoms.size());
    add_geom(shin, GeomKind::capsule, {.049, .15}, {0, 0, -.15});
    for (const double across : {-.03, .03}) add_geom(foot, GeomKind::capsule, {.027, .1}, {.04, across, -.03}, true);
  }
  void add_arm(double side) {
    const Index upper = add_body(
                    1, {0, .17 * side, .06}, 1.6,
                    {{{2 * kSixth, kSixth, -side * kSixth}, -1.5, 1.1, 20}, {{0, kHalf, side * kHalf}, -1.5, 1.1, 20}}),
                lower = add_body(upper, {.18, .18 * side, -.18}, 1.2, {{{0, kHalf, side * kHalf}, -1.6, .9, 20}});
    add_geom(lower, GeomKind::sphere, {.04}, {.18, -.18 * side, .18});
  }
  void add_pairs() {
    for (const Index geom : touching_) add_pair(0, geom);
    add_pair(thigh_[0], thigh_[1]);
    add_pair(shin_[0], shin_[1]);
    add_pair(thigh_[0], shin_[1]);
    add_pair(shin_[0], thigh_[1]);
  }
  void add_pair(Index a, Index b) { model_.pairs.push_back({a, b, 3, {1, 1, .005, 1e-4, 1e-4}, .001, .001, {}, {}}); }

  static constexpr double kHalf = 0.70710678118654757, kSixth = 0.40824829046386302;  ///< roots of 1/2 and 1/6

  ArticulatedDescription model_;
  Index pelvis_ = 0, thigh_[2] = {}, shin_[2] = {};
  std::vector<Index> touching_;  ///< geoms that touch the plane
};

}  // namespace stiction::test
