#pragma once

#include "core/base/real.hpp"

/// The outer loop of proximal Newton (docs/math/body_newton.md). Spaces take its steps: an environment's bodies, a
/// rank's part of them, or blocks of degrees of freedom. It solves a sequence of problems. A proximal term stands in
/// for missing compliance, and its weight falls from problem to problem. Coulomb's law shifts each motion by its slip.
namespace stiction::inline STICTION_ISA {

/// Weight of the proximal term over A's diagonal in the first problem. Then its factor from problem to problem, and its
/// least. Below, rounding over the weight would be more than the proximal term still hides.
inline constexpr double kProxWeightStart = 1e-2, kProxWeightFall = 0.1, kProxWeightLeast = 1e-7;
/// Compliance over A's diagonal from which no proximal term is needed.
inline constexpr double kEnoughCompliance = 1e-5;
/// Sweeps before the first step. Under Coulomb's law they also follow a problem that leads away or takes kLongProblem
/// steps. Each time they are twice as many, up to kMostSweeps: sweeps that begin again lose their momentum.
inline constexpr Index kFirstSweeps = 48, kMostSweeps = 3072, kLongProblem = 12;
/// Share of the iterate's residual that a problem may leave before the next one.
inline constexpr double kProblemPart = 0.1;
/// Steps without a better iterate after which the loop ends.
inline constexpr Index kMostIdleSteps = 100;
/// Share of its first residual to which a linear system is solved: at most a step's, and that of a new problem's first
/// step.
inline constexpr double kStepTolerance = 0.1, kRenewalTolerance = 1e-4;
/// Steps of conjugate gradients or BiCGStab in one linear system, at most. They still give a direction of descent.
inline constexpr Index kMostGradientSteps = 1000;

/// Outcome of the loop.
enum class NewtonEnd : int { solved, stalled, broken, out_of_steps };

/// State of a sequence of problems. Lanes of a team, and ranks, hold equal copies.
struct NewtonSequence {
  double best = __builtin_huge_val();     ///< smallest residual [w]
  double renewed = __builtin_huge_val();  ///< residual before the last problem began [w]
  double first_energy = 0.0;              ///< largest energy of a gradient of this problem
  double prox_weight = 0.0;               ///< weight of the proximal term over A's diagonal
  double least_weight = 0.0;              ///< its last one; 0 where compliance suffices
  Index problem_steps = 0;                ///< steps on this problem
  Index sweeps = kFirstSweeps;            ///< sweeps that are next
  bool has_best = false;

  /// Keeps a residual if it is the smallest; returns true if so.
  STICTION_HD bool keep(double residual) {
    const bool is_best = !has_best || residual < best;
    if (is_best) best = residual;
    has_best = true;
    return is_best;
  }
  /// Returns true if the best iterate is within the tolerance of that scale [w].
  [[nodiscard]] STICTION_HD bool is_within(double tolerance, double scale) const {
    return div_(best, scale) <= tolerance;
  }
  /// Doubles the sweeps that are next.
  STICTION_HD void double_sweeps() { sweeps = sweeps < kMostSweeps ? 2 * sweeps : sweeps; }
  /// A first problem.
  STICTION_HD void start(double weight) {
    prox_weight = weight;
    renewed = __builtin_huge_val();
    first_energy = 0.0;
    problem_steps = 0;
  }
  /// The next problem.
  STICTION_HD void fall() {
    prox_weight = max_(kProxWeightFall * prox_weight, least_weight);
    if (least_weight == 0.0 && prox_weight < kEnoughCompliance) prox_weight = 0.0;
    first_energy = 0.0;
    problem_steps = 0;
  }
  /// Tolerance of a step's linear system where the gradient has that energy (docs/math/body_newton.md).
  STICTION_HD double step_tolerance(double energy) {
    energy = max_(energy, 0.0);
    first_energy = max_(energy, first_energy);
    const double part = first_energy > 0.0 ? div_(energy, first_energy) : 1.0;
    return min_(kStepTolerance, 0.5 * sqrt_(sqrt_(part)));
  }
};

/// Residuals after a step [w].
struct NewtonResidual {
  double iterate;  ///< of the reactions by the law
  double problem;  ///< remaining error of the problem
};

/// Solves `space` by steps of Newton's method, `most` at most; `steps` counts them. `space` has
///
///     double start()              judges where the sequence begins, and returns the residual
///     bool sweeps_first()         whether sweeps find a better beginning
///     bool step()                 one step on the problem; false if the function does not fall along it
///     NewtonResidual evaluate()   judges the reactions, and keeps the best
///     bool is_solved()            whether the best reactions are an answer
///     bool has_sequence()         whether the next problem differs from this one
///     bool can_sweep()            whether sweeps may bring more than steps
///     void sweep()                sweeps from the best reactions, judges them, and begins a first problem there
///     void renew()                begins the next problem by its first step
///
/// and NewtonSequence sequence. All lanes of a team, and all ranks, call it, and return the same.
template <class Space>
STICTION_HD NewtonEnd solve_by_newton(Space& space, Index& steps, Index most) {
  NewtonSequence& sequence = space.sequence;
  const double first = space.start();
  if (space.is_solved()) return NewtonEnd::solved;
  if (!finite_(first)) return NewtonEnd::broken;
  if (most == 0) return NewtonEnd::out_of_steps;
  if (space.sweeps_first()) {
    space.sweep();
    if (space.is_solved()) return NewtonEnd::solved;
  }
  Index idle = 0;
  while (steps < most) {
    const bool is_exhausted = !space.step();
    ++steps;
    const double before = sequence.best;
    const NewtonResidual residual = space.evaluate();
    if (space.is_solved()) return NewtonEnd::solved;
    if (!finite_(residual.iterate)) return NewtonEnd::broken;
    idle = sequence.best < before ? 0 : idle + 1;
    if (idle >= kMostIdleSteps || (is_exhausted && !space.has_sequence())) return NewtonEnd::stalled;
    if (steps >= most) break;
    const bool is_met = is_exhausted || residual.problem <= kProblemPart * residual.iterate;
    const bool is_long = space.can_sweep() && ++sequence.problem_steps >= kLongProblem;
    if (space.can_sweep() && (is_long || (is_met && residual.iterate > sequence.renewed))) {
      space.sweep();
      if (space.is_solved()) return NewtonEnd::solved;
    } else if (space.has_sequence() && is_met) {
      sequence.renewed = residual.iterate;
      space.renew();
      ++steps;
    }
  }
  return NewtonEnd::out_of_steps;
}

}  // namespace stiction::inline STICTION_ISA
