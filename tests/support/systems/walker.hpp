#pragma once

#include "stiction/articulated.hpp"

namespace stiction::test {

/// A box on two legs of a ball and a hinge each, with spheres for feet, over a plane. It has every joint but a slide,
/// limits, dry friction, servos, and contacts of 3 and 4 directions.
inline ArticulatedDescription walker(bool is_elliptic, bool is_rk4 = false) {
  constexpr double kInfinite = __builtin_huge_val();
  ArticulatedDescription model;
  model.timestep = 0.004;
  model.is_elliptic = is_elliptic;
  model.is_rk4 = is_rk4;
  model.bodies.push_back({});
  model.bodies.push_back(
      {0, 1, {0, 0, 0.62}, {1, 0, 0, 0}, 4, {0.01, 0, 0.02}, {1, 0, 0, 0}, {.03, .05, .04}, {.2, 5}});
  model.joints.push_back({});
  model.joints.back().kind = JointKind::free;
  model.dofs.resize(6);
  model.geoms.push_back({0, GeomKind::plane, {}, {}, {1, 0, 0, 0}});
  model.geoms.push_back({1, GeomKind::box, {.1, .15, .08}, {}, {1, 0, 0, 0}});
  model.pairs.push_back({0, 1, 3, {.7, .7, .01, .001, .001}, 0, 0, {}, {}});
  for (int leg = 0; leg < 2; ++leg) {
    const double side = leg == 0 ? 0.1 : -0.1;
    const auto body = static_cast<Index>(model.bodies.size());
    model.bodies.push_back(
        {1, 1, {0, side, -.08}, {1, 0, 0, 0}, .8, {0, 0, -.12}, {1, 0, 0, 0}, {.01, .01, .001}, {1, 40}});
    model.bodies.push_back(
        {body, 1, {0, 0, -.25}, {1, 0, 0, 0}, .5, {.01, 0, -.1}, {1, 0, 0, 0}, {.01, .01, .001}, {2, 60}});
    model.joints.push_back({});
    model.joints.back().kind = JointKind::ball;
    ArticulatedJoint knee;
    knee.axis = {0, 1, 0};
    knee.is_limited = true;
    knee.range = {0.1, 1.5};
    model.joints.push_back(knee);
    for (int k = 0; k < 3; ++k) model.dofs.push_back({.02, .3, 0, {}, 40});
    model.dofs.push_back({.02, .3, .2, {}, 50});
    model.actuators.push_back({2 * leg + 2, 1, {20, 0, 0}, {0, -20, -1}, {-2, 2}, {-kInfinite, kInfinite}});
    model.geoms.push_back({body + 1, GeomKind::sphere, {.05}, {0, 0, -.24}, {1, 0, 0, 0}});
    model.pairs.push_back({0, 2 + leg, 4, {.9, .9, .02, .001, .001}, .005, .005, {}, {}});
  }
  model.equalities.push_back({4, 2, {.1, .3, .2, 0, 0}, {{.05, 1}, {.8, .9, .1, .5, 2}}});
  model.pairs.push_back({2, 3, 3, {.5, .5, .01, .001, .001}, 0, 0, {}, {}});
  return model;
}

}  // namespace stiction::test
