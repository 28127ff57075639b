#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stiction/world.hpp"

namespace stiction::cli {

/// State of one environment after a step.
struct EnvSeen {
  WorldMotion motion;
  EnvStatus status;
  std::array<double, 3> push{};  ///< of the world's contacts [N s]
  std::int64_t contacts = 0;
  double deepest = 0;  ///< penetration of any contact that was found, 0 where none is [m]
};

/// Impulse of contacts with body -1, which is always the first of a pair [N s].
template <class Real>
std::array<double, 3> push_of_world(const BodyBatchView<Real>& contacts, std::span<const Real> impulses, Offset env);
/// Penetration of any contact of an environment, 0 where none is [m].
template <class Real>
double deepest_of(const BodyBatchView<Real>& contacts, Offset env);

/// State of all environments after the last step.
template <class Real>
std::vector<EnvSeen> see(const World<Real>& world);

/// Watches a world step by step: residuals, quality, energy and momentum of docs/howto/stepping.md.
class StepMonitor {
 public:
  /// A world of that description whose motion is `motion`. Residuals above `tolerance` lower the quality. `steps` of
  /// `dt` are ahead.
  StepMonitor(const WorldDescription& description, double dt, std::vector<WorldMotion> motion, double tolerance,
              std::int64_t steps);

  /// After each step.
  void look(std::span<const EnvSeen> envs);

  [[nodiscard]] const std::vector<double>& residuals() const { return residuals_; }
  /// Mean over environment-steps of min(1, tolerance / residual); 0 where the residual is not finite.
  [[nodiscard]] double quality() const;
  [[nodiscard]] std::int64_t contacts() const { return contacts_; }    ///< of all environment-steps
  [[nodiscard]] std::int64_t overflows() const { return overflows_; }  ///< environment-steps over capacity
  [[nodiscard]] const std::array<std::int64_t, kEnvCodeCount>& codes() const { return codes_; }
  [[nodiscard]] double energy_begin() const { return energy_begin_; }  ///< mean over environments [J]
  [[nodiscard]] double energy_end() const;
  [[nodiscard]] double largest_rise() const { return largest_rise_; }  ///< of one environment's energy in one step [J]
  /// Largest change of an environment's momentum in a step that neither weight nor the world's contacts explain [N s].
  [[nodiscard]] double momentum_drift() const { return momentum_drift_; }
  [[nodiscard]] double deepest() const { return deepest_; }  ///< penetration of any contact that was found [m]

 private:
  double tolerance_;
  std::int64_t stride_ = 1;  ///< residuals of every so many steps are kept
  std::array<double, 3> weight_{};
  std::vector<WorldMotion> before_;
  std::vector<double> residuals_;
  std::array<std::int64_t, kEnvCodeCount> codes_{};
  double quality_sum_ = 0, energy_begin_ = 0, largest_rise_ = 0, momentum_drift_ = 0, deepest_ = 0;
  std::int64_t steps_ = 0, env_steps_ = 0, contacts_ = 0, overflows_ = 0;
};

}  // namespace stiction::cli
