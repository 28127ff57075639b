#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stiction/world.hpp"

namespace stiction::cli {

/// Watches a world step by step; what docs/stepping.md calls residuals, quality, energy and momentum.
template <class Real>
class StepMonitor {
 public:
  /// Residuals above `tolerance` lower the quality. `steps` are ahead.
  StepMonitor(const World<Real>& world, double tolerance, std::int64_t steps);

  /// After each step.
  void look(const World<Real>& world);

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
  std::array<double, 3> push_of_world(const World<Real>& world, Offset env) const;

  double tolerance_;
  std::int64_t stride_;  ///< residuals of every so many steps are kept
  std::array<double, 3> weight_{};
  std::vector<WorldMotion> before_;
  std::vector<double> residuals_;
  std::array<std::int64_t, kEnvCodeCount> codes_{};
  double quality_sum_ = 0, energy_begin_ = 0, largest_rise_ = 0, momentum_drift_ = 0, deepest_ = 0;
  std::int64_t steps_ = 0, env_steps_ = 0, contacts_ = 0, overflows_ = 0;
};

}  // namespace stiction::cli
