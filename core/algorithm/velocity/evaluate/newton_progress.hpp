#pragma once

#include <cstdint>

#include "core/algorithm/residual/final_residual.hpp"
#include "core/job/velocity_job.hpp"

/// Progress of an environment of Newton's method in velocities, and its limits.
namespace stiction::inline STICTION_ISA {

/// Compliance below this share of A's diagonal is brought up to it by a proximal term.
inline constexpr double kLeastCompliance = 1e-4;
/// A warm start's contact sticks if its tangential reaction is less than this share of its cone's limit.
inline constexpr double kInsideCone = 0.999;
/// Share of the tolerance at which the estimate of the error proposes an answer.
inline constexpr double kProposeAt = 0.3;
/// Error at which the first of several problems is left, relative: the next one changes it by more.
inline constexpr double kFirstGoal = 1e-2;
/// Evaluations within which the residual is halved, or the lane is given up.
inline constexpr int kMostUseless = 4;
/// Steps without a better estimate before the lane is evaluated.
inline constexpr int kMostIdle = 8;
/// In single precision, once it has been evaluated and where one problem is solved (docs/math/velocity_newton.md).
inline constexpr int kMostIdleOnceEvaluated = 1;
/// Steps of one environment, at most.
inline constexpr Index kMostSteps = 200;
/// Evaluations of one environment, at most.
inline constexpr int kMostEvaluations = 60;

/// In single precision steps end at rounding, at a relative residual of 1e-7 to 1e-5. Below this tolerance they are
/// taken in double.
inline constexpr double kLeastSingle = 1e-5;

/// Requirement of an environment: its own tolerance, or the solve's.
template <class Real>
STICTION_HD double tolerance_of(const VelocityJob<Real>& job, Offset env) {
  const double* const own = job.batch.env_tolerance;
  return own != nullptr && own[env] >= 0.0 ? own[env] : job.tolerance;
}
/// Returns true if the steps of an environment are taken in double, though the batch has single precision.
template <class Real>
STICTION_HD bool steps_in_double(const VelocityJob<Real>& job, Offset env) {
  return sizeof(Real) == sizeof(float) && tolerance_of(job, env) < kLeastSingle;
}

/// Progress of an environment.
struct LaneProgress {
  double tolerance = 0.0;
  double scale = 1.0;                  ///< the largest island's error scale                    [w]
  double absolute_tolerance = 0.0;     ///<                                                     [w]
  double goal = 0.0;                   ///< error, relative, at which the lane is evaluated
  double best = __builtin_huge_val();  ///< least residual so far, relative
  double mark = __builtin_huge_val();  ///< residual that is to be halved, relative
  double residual = 0.0;               ///< the last one, in shares of the largest scale        [w]
  double relative = 0.0;               ///< over that scale                                     [-]
  double absolute = 0.0;               ///< largest error of a contact                          [w]
  std::uint32_t flags = 0;             ///< EnvFlag bits
  Index max_iterations = 0;
  Index steps = 0;
  int useless = 0;
  int evaluations = 0;
  Index mixed = 0;  ///< evaluations that the next shift may be mixed of
  bool is_busy = false;
  bool is_answered = false;
  bool is_rounding = false;
  bool starts_at_velocity = false;  ///< and not at the velocities of the reactions
  bool has_outer = false;           ///< solves a sequence of problems: Coulomb's law, or a proximal term

  /// Returns the tolerance that the batch, or the solve, asks of an environment. `most`: steps, whatever that is.
  template <class Real>
  STICTION_HD void set_limits(const VelocityJob<Real>& job, Offset env, Index most) {
    const Index* const own_iterations = job.batch.env_max_iterations;
    tolerance = tolerance_of(job, env);
    absolute_tolerance = job.absolute_tolerance;
    max_iterations = own_iterations != nullptr && own_iterations[env] >= 0 ? own_iterations[env] : job.max_iterations;
    max_iterations = max_iterations < most ? max_iterations : most;
  }
  /// Adds a residual of reactions in precision Real.
  template <class Real>
  STICTION_HD void take(const FinalResidual& found) {
    const Verdict verdict = judge<Real>(found, scale, {tolerance, absolute_tolerance});
    residual = verdict.relative * scale;
    relative = verdict.relative;
    absolute = verdict.absolute;
    is_rounding = verdict.is_rounding;
    is_answered = verdict.is_solved || verdict.is_rounding;
  }
  [[nodiscard]] STICTION_HD VelocityResult result() const {
    return {relative, absolute, flags, steps, is_answered, is_answered && is_rounding};
  }
};

}  // namespace stiction::inline STICTION_ISA
