#include "stiction/world_derivative.hpp"

#include <algorithm>
#include <string>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "core/job/shape_pairs.hpp"
#include "core/runtime/batch/body_jacobian.hpp"
#include "core/runtime/check/expect.hpp"
#include "core/runtime/world/spin_change.hpp"
#include "core/runtime/world/world_model.hpp"

namespace stiction {

namespace {

template <class Real>
World<Real>& checked(World<Real>& world) {
  if (world.options().solver.max_contacts_per_env > 0)
    refuse("world: solver.max_contacts_per_env = " + std::to_string(world.options().solver.max_contacts_per_env) +
           ", and what a capacity drops is not told: differentiate a world without one (0)");
  if (world.options().solver.box_friction)
    refuse(
        "world: solver.box_friction = true, and boxed friction has no derivative: differentiate a world with "
        "friction cones (false)");
  return world;
}

template <class T>
std::vector<T> copy(const T* numbers, Offset count) {
  return {numbers, numbers + count};
}

/// Derivatives of losses by all that is J's and M's.
struct Pulled {
  std::vector<double> J, M, v_free, target, R, mu;
};

}  // namespace

template <class Real>
struct WorldStep<Real>::Parts {
  Parts(World<Real>& world, const DerivativeOptions& options)
      : derivative(Device::cpu(), with_law(options, world.options().solver.law)),
        model(world.description(), world.options()),
        inertia(world.description().bodies.size()),
        env_count(world.env_count()),
        body_count(world.body_count()),
        step(world.options().stepping.dt) {
    for (std::size_t body = 0; body < inertia.size(); ++body) inertia[body] = world.description().bodies[body].inertia;
    for (const WorldShape& shape : world.description().shapes) shape_mu.push_back(shape.mu);
    const WorldState<Real> before = world.state();
    const std::vector<Real> twist(before.twist.begin(), before.twist.end());
    orientation.assign(before.orientation.begin(), before.orientation.end());
    world.step();
    const BodyBatchView<Real> contacts = world.contacts();
    const std::span<const EnvStatus> records = world.status();
    status.assign(records.begin(), records.end());
    env_contacts = copy(contacts.env_contact_offsets, env_count + 1);
    mu = copy(contacts.mu, contacts.contact_count);
    pair.reserve(mu.size());
    for (Offset c = 0; c < contacts.contact_count; ++c)
      pair.push_back(world_pair(model.view(), static_cast<Offset>(contacts.contact_id[c] / kFeatures)).shapes);
    inv_mass = copy(contacts.inv_mass, env_count * body_count);
    inv_inertia = copy(contacts.inv_inertia, 6 * env_count * body_count);
    jacobians =
        body_jacobians<Real>(contacts, twist, world.impulses(), world.options().stepping, world.options().solver.law);
    solved = velocities(jacobians.batch.view(), std::span<const double>(jacobians.impulse), options.threads);
  }

  static DerivativeOptions with_law(DerivativeOptions options, Law law) {
    if (!options.law) options.law = law;
    return options;
  }

  /// Returns the loss's derivative by the twists that the contacts left, from that by the state after the step.
  [[nodiscard]] std::vector<double> before_turning(std::span<const Real> twist, std::span<const Real> position) const {
    std::vector<double> bar(twist.begin(), twist.end());
    for (std::size_t slot = 0; slot < bar.size() / 6; ++slot) {
      for (std::size_t k = 0; k < 3 && !position.empty(); ++k)
        bar[6 * slot + k] += step * static_cast<double>(position[3 * slot + k]);
      const std::array<double, 3>& moments = inertia[slot % at(body_count)];
      if (moments[0] == moments[1] && moments[1] == moments[2]) continue;
      std::array<double, 4> q{};
      std::array<double, 3> spin{}, sum{};
      for (std::size_t k = 0; k < 4; ++k) q[k] = static_cast<double>(orientation[4 * slot + k]);
      for (std::size_t k = 0; k < 3; ++k) spin[k] = solved[6 * slot + 3 + k];
      const std::array<double, 9> change = spin_change(q, moments, spin, step);
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) sum[k] += change[3 * i + k] * bar[6 * slot + 3 + i];
      std::copy(sum.begin(), sum.end(), bar.begin() + static_cast<std::ptrdiff_t>(6 * slot + 3));
    }
    return bar;
  }

  [[nodiscard]] Pulled pull(const std::vector<double>& bar, std::vector<GradientStatus>& records) const {
    const JacobianBatchView<double> view = jacobians.batch.view();
    const auto room = [](Offset size) { return std::vector<double>(at(size)); };
    Pulled to{room(view.entry_count), room(view.mass_count), room(view.dof_count),
              room(view.row_count),   room(view.row_count),  room(view.row_count)};
    derivative.vjp(view, ReactionView<double>{jacobians.impulse.data(), nullptr},
                   JacobianSolutionCotangentView<double>{nullptr, nullptr, bar.data()},
                   JacobianBatchCotangentView<double>{to.J.data(), to.M.data(), to.v_free.data(), to.target.data(),
                                                      to.R.data(), to.mu.data(), nullptr, nullptr},
                   records.data());
    return to;
  }

  /// Contacts of an environment: their own numbers, and those that restitution and depth depend on.
  void add_contacts(Offset env, const Pulled& from, std::vector<double>& twist, WorldGradient<Real>& to) const {
    const JacobianBatchView<double> view = jacobians.batch.view();
    for (Offset c = env_contacts[at(env)]; c < env_contacts[at(env) + 1]; ++c) {
      const double target = from.target[at(3 * c)], by_mu = from.mu[at(3 * c + 1)] + from.mu[at(3 * c + 2)];
      const double depth = target * jacobians.target_by_depth[at(c)], bounce = target * jacobians.bounce[at(c)];
      to.depth[at(c)] = static_cast<Real>(depth);
      to.contact_mu[at(c)] = static_cast<Real>(by_mu);
      for (const Index place : {pair[at(c)].shape_a, pair[at(c)].shape_b}) {
        const Index shape = model.described(place);
        Real& sum = to.friction[at(env) * shape_mu.size() + at(shape)];
        if (shape_mu[at(shape)] > 0.0)
          sum += static_cast<Real>(by_mu * 0.5 * static_cast<double>(mu[at(c)]) / shape_mu[at(shape)]);
      }
      for (Offset k = view.row_offsets[3 * c]; k < view.row_offsets[3 * c + 1]; ++k) {
        const Index dof = view.column[k];
        const Offset slot = env * body_count + dof / 6;
        twist[at(6 * slot + dof % 6)] -= bounce * view.J[k];
        if (dof % 6 < 3) to.position[at(3 * slot + dof % 6)] -= static_cast<Real>(depth * view.J[k]);
      }
    }
  }

  /// Adds the terms that forces and the twists at the beginning share, v_free.
  void add_bodies(Offset env, const Pulled& from, const std::vector<double>& twist, WorldGradient<Real>& to) const {
    for (Offset slot = env * body_count; slot < (env + 1) * body_count; ++slot) {
      const double* const bar = from.v_free.data() + 6 * slot;
      const Real* const I = inv_inertia.data() + 6 * slot;
      const Index row[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
      for (std::size_t k = 0; k < 6; ++k) to.twist[6 * at(slot) + k] = static_cast<Real>(twist[6 * at(slot) + k]);
      for (std::size_t k = 0; k < 3; ++k) {
        double turn = 0.0;
        for (std::size_t j = 0; j < 3; ++j) turn += static_cast<double>(I[row[k][j]]) * bar[3 + j];
        to.wrench[6 * at(slot) + k] = static_cast<Real>(step * static_cast<double>(inv_mass[at(slot)]) * bar[k]);
        to.wrench[6 * at(slot) + 3 + k] = static_cast<Real>(step * turn);
      }
    }
  }

  Derivative derivative;
  WorldModel<Real> model;
  std::vector<std::array<double, 3>> inertia;  ///< of each body of an environment
  std::vector<double> shape_mu;
  Offset env_count;
  Index body_count;
  double step;
  std::vector<Real> orientation;  ///< before the step
  std::vector<EnvStatus> status;
  std::vector<Offset> env_contacts;
  std::vector<ShapePair> pair;  ///< of each contact
  std::vector<Real> mu, inv_mass, inv_inertia;
  BodyJacobians jacobians;
  std::vector<double> solved;  ///< twists as the contacts left them
};

template <class Real>
WorldStep<Real>::WorldStep(World<Real>& world, const DerivativeOptions& options) {
  const ScopedFpEnv fp_env;
  parts_ = std::make_unique<Parts>(checked(world), options);
}
template <class Real>
WorldStep<Real>::~WorldStep() = default;
template <class Real>
WorldStep<Real>::WorldStep(WorldStep&&) noexcept = default;
template <class Real>
WorldStep<Real>& WorldStep<Real>::operator=(WorldStep&&) noexcept = default;

template <class Real>
WorldGradient<Real> WorldStep<Real>::pull(std::span<const Real> twist, std::span<const Real> position) const {
  const ScopedFpEnv fp_env;
  const Parts& parts = *parts_;
  const std::size_t bodies = at(parts.env_count * parts.body_count), contacts = parts.pair.size();
  expect_length("twist", twist.size(), 6 * bodies, "six numbers per body");
  if (!position.empty()) expect_length("position", position.size(), 3 * bodies, "three numbers per body; or none");
  WorldGradient<Real> to;
  const auto room = [](std::size_t size) { return std::vector<Real>(size); };
  to.position = room(3 * bodies);
  to.twist = to.wrench = room(6 * bodies);
  to.friction = room(parts.shape_mu.size() * at(parts.env_count));
  to.contact_mu = to.depth = room(contacts);
  to.status.resize(at(parts.env_count));
  const Pulled pulled = parts.pull(parts.before_turning(twist, position), to.status);
  std::vector<double> by_twist = pulled.v_free;
  for (Offset env = 0; env < parts.env_count; ++env) {
    std::uint32_t& flags = to.status[at(env)].flags;
    // An environment that was refused stays where it is.
    if (parts.status[at(env)].code == EnvCode::invalid_input) flags |= kGradientInvalidInput;
    if ((flags & kGradientRefused) != 0) continue;
    for (std::size_t k = 3 * at(env * parts.body_count); k < 3 * at((env + 1) * parts.body_count); ++k)
      to.position[k] = position.empty() ? Real(0) : position[k];
    parts.add_contacts(env, pulled, by_twist, to);
    parts.add_bodies(env, pulled, by_twist, to);
  }
  return to;
}

template class WorldStep<float>;
template class WorldStep<double>;

}  // namespace stiction
