#include "cli/step_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stiction::cli {

namespace {

/// Residuals kept at most: beyond that, those of every second, third, ... step.
constexpr std::int64_t kMostResiduals = std::int64_t{1} << 24;

double mean_energy(const std::vector<WorldMotion>& motion) {
  double sum = 0;
  for (const WorldMotion& env : motion) sum += env.kinetic + env.potential;
  return motion.empty() ? 0 : sum / static_cast<double>(motion.size());
}

}  // namespace

StepMonitor::StepMonitor(const WorldDescription& description, double dt, std::vector<WorldMotion> motion,
                         double tolerance, std::int64_t steps)
    : tolerance_(tolerance), before_(std::move(motion)) {
  const auto envs = static_cast<std::int64_t>(before_.size());
  stride_ = std::max<std::int64_t>(1, (envs * steps + kMostResiduals - 1) / kMostResiduals);
  double mass = 0;
  for (const WorldBody& body : description.bodies) mass += body.mass;
  for (std::size_t k = 0; k < 3; ++k) weight_[k] = mass * description.gravity[k] * dt;
  energy_begin_ = mean_energy(before_);
}

template <class Real>
std::array<double, 3> push_of_world(const BodyBatchView<Real>& contacts, std::span<const Real> impulses, Offset env) {
  std::array<double, 3> sum{};
  for (Offset c = contacts.env_contact_offsets[env]; c < contacts.env_contact_offsets[env + 1]; ++c) {
    if (contacts.body_a[c] >= 0) continue;
    const Real n[3] = {contacts.normal[3 * c], contacts.normal[3 * c + 1], contacts.normal[3 * c + 2]};
    Real t1[3];
    Real t2[3];
    contact_tangents(n, t1, t2);
    const Real* const impulse = impulses.data() + 3 * c;
    for (std::size_t k = 0; k < 3; ++k)
      sum[k] += static_cast<double>(n[k]) * static_cast<double>(impulse[0]) +
                static_cast<double>(t1[k]) * static_cast<double>(impulse[1]) +
                static_cast<double>(t2[k]) * static_cast<double>(impulse[2]);
  }
  return sum;
}

template <class Real>
double deepest_of(const BodyBatchView<Real>& contacts, Offset env) {
  double deepest = 0;
  for (Offset c = contacts.env_contact_offsets[env]; c < contacts.env_contact_offsets[env + 1]; ++c)
    deepest = std::max(deepest, static_cast<double>(contacts.depth[c]));
  return deepest;
}

template <class Real>
std::vector<EnvSeen> see(const World<Real>& world) {
  const std::vector<WorldMotion> motion = world.motion();
  const std::span<const EnvStatus> status = world.status();
  const BodyBatchView<Real> contacts = world.contacts();
  std::vector<EnvSeen> seen;
  for (Offset env = 0; env < world.env_count(); ++env) {
    const auto e = static_cast<std::size_t>(env);
    seen.push_back({motion[e], status[e], push_of_world(contacts, world.impulses(), env),
                    contacts.env_contact_offsets[env + 1] - contacts.env_contact_offsets[env],
                    deepest_of(contacts, env)});
  }
  return seen;
}

void StepMonitor::look(std::span<const EnvSeen> envs) {
  for (std::size_t e = 0; e < envs.size(); ++e) {
    const WorldMotion& now = envs[e].motion;
    const WorldMotion& before = before_[e];
    const double residual = envs[e].status.residual;
    if (steps_ % stride_ == 0) residuals_.push_back(residual);
    if (residual <= tolerance_) {
      quality_sum_ += 1;
    } else if (std::isfinite(residual)) {
      quality_sum_ += tolerance_ / residual;
    }
    ++codes_[static_cast<std::size_t>(envs[e].status.code)];
    overflows_ += (envs[e].status.flags & kFlagContactsDropped) != 0 ? 1 : 0;
    largest_rise_ = std::max(largest_rise_, (now.kinetic + now.potential) - (before.kinetic + before.potential));
    double square = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double rest = now.momentum[k] - before.momentum[k] - weight_[k] - envs[e].push[k];
      square += rest * rest;
    }
    momentum_drift_ = std::max(momentum_drift_, std::sqrt(square));
    deepest_ = std::max(deepest_, envs[e].deepest);
    contacts_ += envs[e].contacts;
    before_[e] = now;
  }
  env_steps_ += static_cast<std::int64_t>(envs.size());
  ++steps_;
}

double StepMonitor::quality() const {
  return env_steps_ > 0 ? quality_sum_ / static_cast<double>(env_steps_) : 1;
}
double StepMonitor::energy_end() const {
  return mean_energy(before_);
}

template std::array<double, 3> push_of_world(const BodyBatchView<float>&, std::span<const float>, Offset);
template std::array<double, 3> push_of_world(const BodyBatchView<double>&, std::span<const double>, Offset);
template double deepest_of(const BodyBatchView<float>&, Offset);
template double deepest_of(const BodyBatchView<double>&, Offset);
template std::vector<EnvSeen> see(const World<float>&);
template std::vector<EnvSeen> see(const World<double>&);

}  // namespace stiction::cli
