#pragma once

#include <memory>
#include <span>
#include <vector>

#include "distributed/newton/domain_team.hpp"
#include "distributed/newton/schwarz.hpp"

namespace stiction::distributed {

/// One rank's part of Newton's method on one environment: newton_bodies.hpp with the contacts and bodies of the
/// rank's reach in place of all (docs/math/domain_newton.md). All ranks call the same functions, and get the same
/// answers.
class DomainSpace {
 public:
  /// `points`: where bodies are. Objects passed by reference outlive this.
  template <class Real>
  DomainSpace(Transport& transport, const BodyEnv<Real>& env, const SiParams& params, Law law, const Domains& domains,
              const Reach& reach, std::span<const int> home, std::span<const Point> points, Ordering ordering);

  /// Begins a first problem at those impulses, three numbers of each contact in the environment's order.
  template <class Real>
  void start(const BodyEnv<Real>& env, const Real* impulse, NewtonSequence& sequence);
  /// Reactions and descent. Returns the largest motion that the descent would bring to a contact [w].
  double renew_reactions();
  /// One Newton step. Returns false if the function falls by no more than rounding.
  bool take_step(NewtonSequence& sequence);
  /// The centre moves to the reactions, the weight falls, and the first step of the new problem is taken.
  void renew_problem(NewtonSequence& sequence);

  /// Returns the last weight of the proximal term.
  [[nodiscard]] double least_weight() const;
  [[nodiscard]] const SpaceContact& contact(Index p) const { return workspace_.contact[p]; }
  /// Steps of the solvers of linear systems so far.
  [[nodiscard]] std::int64_t linear_steps() const { return linear_steps_; }

 private:
  void set_weight(double weight);
  void assemble_curvature();
  void solve_linear(SpaceSystem system, double tolerance);
  template <class F>
  void for_contacts(F&& f) {
    for (const Index p : reach_.contacts) f(workspace_.contact[p]);
  }
  template <class F>
  void for_numbers(F&& f) {
    for (const Index body : reach_.seen)
      for (Index k = 0; k < kBodyBlock; ++k) f(static_cast<Offset>(body) * kBodyBlock + k);
  }

  const Domains& domains_;
  const Reach& reach_;
  DomainTeam team_;
  double compliance_, largest_mean_ = 0;
  std::unique_ptr<double[]> memory_;
  SpaceWorkspace workspace_;
  std::vector<char> is_row_;  ///< of each body
  Schwarz schwarz_;
  std::int64_t linear_steps_ = 0;
};

}  // namespace stiction::distributed
