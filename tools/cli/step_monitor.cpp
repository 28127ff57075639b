#include "tools/cli/step_monitor.hpp"

#include <algorithm>
#include <cmath>

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

template <class Real>
StepMonitor<Real>::StepMonitor(const World<Real>& world, double tolerance, std::int64_t steps)
    : tolerance_(tolerance),
      stride_(std::max<std::int64_t>(1, (world.env_count() * steps + kMostResiduals - 1) / kMostResiduals)),
      before_(world.motion()) {
  double mass = 0;
  for (const WorldBody& body : world.description().bodies) mass += body.mass;
  for (std::size_t k = 0; k < 3; ++k) weight_[k] = mass * world.description().gravity[k] * world.options().stepping.dt;
  energy_begin_ = mean_energy(before_);
}

/// Impulses of contacts with body -1, which is always the first of a pair.
template <class Real>
std::array<double, 3> StepMonitor<Real>::push_of_world(const World<Real>& world, Offset env) const {
  const BodyBatchView<Real> contacts = world.contacts();
  const std::span<const Real> impulses = world.impulses();
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
void StepMonitor<Real>::look(const World<Real>& world) {
  const std::vector<WorldMotion> now = world.motion();
  const std::span<const EnvStatus> status = world.status();
  for (Offset env = 0; env < world.env_count(); ++env) {
    const auto e = static_cast<std::size_t>(env);
    const double residual = status[e].residual;
    if (steps_ % stride_ == 0) residuals_.push_back(residual);
    if (residual <= tolerance_) {
      quality_sum_ += 1;
    } else if (std::isfinite(residual)) {
      quality_sum_ += tolerance_ / residual;
    }
    ++codes_[static_cast<std::size_t>(status[e].code)];
    overflows_ += (status[e].flags & kFlagContactsDropped) != 0 ? 1 : 0;
    largest_rise_ =
        std::max(largest_rise_, (now[e].kinetic + now[e].potential) - (before_[e].kinetic + before_[e].potential));
    const std::array<double, 3> push = push_of_world(world, env);
    double square = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double rest = now[e].momentum[k] - before_[e].momentum[k] - weight_[k] - push[k];
      square += rest * rest;
    }
    momentum_drift_ = std::max(momentum_drift_, std::sqrt(square));
  }
  before_ = now;
  const BodyBatchView<Real> contacts = world.contacts();
  for (Offset c = 0; c < contacts.contact_count; ++c)
    deepest_ = std::max(deepest_, static_cast<double>(contacts.depth[c]));
  contacts_ += world.contact_offsets().back();
  env_steps_ += world.env_count();
  ++steps_;
}

template <class Real>
double StepMonitor<Real>::quality() const {
  return env_steps_ > 0 ? quality_sum_ / static_cast<double>(env_steps_) : 1;
}
template <class Real>
double StepMonitor<Real>::energy_end() const {
  return mean_energy(before_);
}

template class StepMonitor<float>;
template class StepMonitor<double>;

}  // namespace stiction::cli
