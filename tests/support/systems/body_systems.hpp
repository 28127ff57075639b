#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "scenes/body_scenes.hpp"
#include "scenes/rng.hpp"
#include "stiction/bodies.hpp"

/// Small environments in body form.
namespace stiction::test {

/// Weight of a step of 5 ms [m/s].
inline constexpr double kFall = 0.005 * 9.81;

/// A ball of radius r and mass m over the floor at z = 0, contact 0 below it, without weight.
inline BodyEnvironment<double> ball_on_floor(double radius, double mass, double mu) {
  BodyEnvironment<double> env;
  BodyEnvironment<double>::Body ball;
  ball.inv_mass = 1 / mass;
  const double inertia = 1 / (0.4 * mass * radius * radius);
  ball.inv_inertia = {inertia, 0, 0, inertia, 0, inertia};
  env.bodies.push_back(ball);
  BodyEnvironment<double>::Contact contact;
  contact.arm_b = {0, 0, -radius};
  contact.mu = mu;
  env.contacts.push_back(contact);
  return env;
}

/// Bodies and contacts thrown together: every branch of a body, and no mechanics behind it. Runs of contacts between
/// one pair, a kinematic body, frictionless and bouncing contacts, gaps and overlaps.
inline BodyEnvironment<double> random_bodies(std::uint64_t seed, Index bodies, Index contacts) {
  scenes::Rng rng(seed * 0x9e3779b97f4a7c15ULL + 1);
  BodyEnvironment<double> env;
  for (Index k = 0; k < bodies; ++k) {
    auto& body = env.bodies.emplace_back();
    body.inv_mass = rng.uniform(0.5, 2);
    const double xy = rng.symmetric(0.2);
    const double xz = rng.symmetric(0.2);
    body.inv_inertia = {rng.uniform(1, 3), xy, xz, rng.uniform(1, 3), rng.symmetric(0.2), rng.uniform(1, 3)};
    for (double& v : body.twist) v = rng.symmetric(1);
    for (double& v : body.twist_change) v = rng.symmetric(0.1);
    body.kinematic = k > 1 && rng.chance(0.1);
  }
  for (Index k = 0; k < contacts; ++k) {
    auto& contact = env.contacts.emplace_back();
    if (k > 0 && rng.chance(0.5)) {
      contact.body_a = env.contacts[static_cast<std::size_t>(k) - 1].body_a;
      contact.body_b = env.contacts[static_cast<std::size_t>(k) - 1].body_b;
    } else {
      contact.body_b = rng.below(2);  // the first two are never kinematic
      contact.body_a = rng.below(bodies) - 1;
      if (contact.body_a == contact.body_b) contact.body_a = -1;
      if (rng.chance(0.5)) std::swap(contact.body_a, contact.body_b);
    }
    if (bodies > 2 && rng.chance(0.6) && !env.bodies[static_cast<std::size_t>(k % bodies)].kinematic) {
      contact.body_b = k % bodies;
      if (contact.body_a == contact.body_b) contact.body_a = -1;
    }
    std::array<double, 3> n{};
    double length2 = 0;
    while (length2 < 0.01 || length2 > 1) {
      for (double& v : n) v = rng.symmetric(1);
      length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    }
    for (std::size_t i = 0; i < 3; ++i) {
      contact.normal[i] = n[i] / std::sqrt(length2);
      contact.arm_a[i] = rng.symmetric(0.5);
      contact.arm_b[i] = rng.symmetric(0.5);
    }
    contact.mu = rng.chance(0.1) ? 0 : rng.uniform(0.1, 1);
    contact.depth = rng.symmetric(0.01);
    contact.restitution = rng.chance(0.5) ? 0 : rng.uniform();
    contact.id = static_cast<std::uint64_t>(k);
  }
  return env;
}

/// A mass that is a number and a geometry that makes none of it: squares are beyond single precision.
inline BodyEnvironment<float> beyond_single_precision() {
  BodyEnvironment<float> env = scenes::rounded(ball_on_floor(0.1, 2.0, 0.5));
  env.bodies[0].inv_mass = 3e38F;
  env.contacts[0].arm_b = {1e19F, 1e19F, -1e19F};
  env.bodies[0].twist[2] = -1;
  return env;
}

/// Newton's method in body space, on one thread.
inline BodySolverOptions newton_options(Law law, BodyPreconditioner preconditioner) {
  BodySolverOptions options;
  options.law = law;
  options.method = BodyMethod::newton;
  options.space.preconditioner = preconditioner;
  options.threads = 1;
  return options;
}

template <class Real>
BodyEnvironment<Real> as(const BodyEnvironment<double>& env) {
  if constexpr (std::is_same_v<Real, float>) {
    return scenes::rounded(env);
  } else {
    return env;
  }
}

template <class Real>
BodyBatch<Real> batch_of(const std::vector<BodyEnvironment<Real>>& envs) {
  BodyBatch<Real> batch;
  for (const auto& env : envs) batch.add(env);
  return batch;
}

}  // namespace stiction::test
