#pragma once

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "tests/support/systems/small_systems.hpp"

namespace stiction::test {

/// A system of one or two cones whose answer a reader can work out, with the working in `why`.
struct HandAnswer {
  std::string why;
  Environment<double> env;
  Law law;
  std::vector<double> lambda, w;
};

inline std::vector<HandAnswer> hand_answers() {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  std::vector<HandAnswer> all;
  const auto both_laws = [&](const std::string& why, const Environment<double>& env, const std::vector<double>& lambda,
                             const std::vector<double>& w) {
    for (const Law law : kBothLaws) all.push_back({why, env, law, lambda, w});
  };
  const auto box_of = [&](double b, double lo, double hi) {
    Environment<double> env = system({box()}, {2}, {b});
    env.lo = {lo};
    env.hi = {hi};
    return env;
  };

  both_laws("a free row stands still: 2 * 1.5 - 3 = 0", system({free_row()}, {2}, {-3}), {1.5}, {0});
  both_laws("a free row pulls as well as it pushes", system({free_row()}, {2}, {3}), {-1.5}, {0});
  both_laws("a pressed contact rests", system({unilateral()}, {2}, {-3}), {1.5}, {0});
  both_laws("a separating contact lets go", system({unilateral()}, {2}, {3}), {0}, {3});
  both_laws("joint friction holds: 0.5 < 1", box_of(-1, -1, 1), {0.5}, {0});
  both_laws("joint friction slips at its upper bound: w = 2 * 1 - 5", box_of(-5, -1, 1), {1}, {-3});
  both_laws("joint friction slips at its lower bound: w = 5 - 2", box_of(5, -1, 1), {-1}, {3});
  both_laws("a box without bounds is a free row", box_of(-5, -kInfinity, kInfinity), {2.5}, {0});
  both_laws("bounds that coincide fix the reaction", box_of(-5, 0.25, 0.25), {0.25}, {-4.5});
  both_laws("a column of two unit masses: the lower contact carries both weights",
            system({unilateral(), unilateral()}, {1, -1, -1, 2}, {-1, 0}), {2, 1}, {0, 0});
  both_laws("a free row and a contact on one body: A all ones, w = lambda_0 + lambda_1 + b",
            system({free_row(), unilateral()}, {1, 1, 1, 1}, {-1, 2}), {1, 0}, {0, 3});

  Environment<double> compliant = system({unilateral()}, {1}, {-3});
  compliant.R = {0.5};
  both_laws("compliance adds to the diagonal: 1.5 * 2 - 3 = 0", compliant, {2}, {0});

  both_laws("a contact at rest", contact({1, 1, 1}, {-2, 0, 0}, 0.5), {2, 0, 0}, {0, 0, 0});
  both_laws("a contact that sticks: 0.5 < mu * 2", contact({1, 1, 1}, {-2, 0.5, 0}, 0.5), {2, -0.5, 0}, {0, 0, 0});
  both_laws("a contact that separates while it slides", contact({1, 1, 1}, {1, 0.25, 0}, 0.5), {0, 0, 0}, {1, 0.25, 0});
  both_laws("without friction only the normal reacts", contact({1, 1, 1}, {-2, 3, 1}, 0), {2, 0, 0}, {0, 3, 1});
  both_laws("without friction a separating contact stays free", contact({1, 1, 1}, {2, 3, 1}, 0), {0, 0, 0}, {2, 3, 1});

  const Environment<double> slide = contact({1, 1, 1}, {-2, 3, 0}, 0.5);
  all.push_back({"sliding, Coulomb: the normal rests and friction mu * 2 opposes the motion",
                 slide,
                 Law::coulomb,
                 {2, -1, 0},
                 {0, 2, 0}});
  all.push_back({"sliding, convex: w_n = mu norm(w_t) lifts off, n - 2 = (3 - n / 2) / 2 gives n = 2.8",
                 slide,
                 Law::convex,
                 {2.8, -1.4, 0},
                 {0.8, 1.6, 0}});
  // Separating by 1 while sliding by 3: the convex law still reacts, because mu * 3 > 1.
  const Environment<double> skim = contact({1, 1, 1}, {1, 3, 0}, 0.5);
  all.push_back({"skimming, Coulomb: it separates, so it does not react", skim, Law::coulomb, {0, 0, 0}, {1, 3, 0}});
  all.push_back(
      {"skimming, convex: n + 1 = (3 - n / 2) / 2 gives n = 0.4", skim, Law::convex, {0.4, -0.2, 0}, {1.4, 2.8, 0}});

  Environment<double> planar = system({friction(2)}, {1, 0, 0, 1}, {-2, 3});
  planar.mu = {0, 0.5};
  all.push_back({"the same sliding in the plane, two rows", planar, Law::coulomb, {2, -1}, {0, 2}});
  all.push_back({"the same sliding in the plane, two rows", planar, Law::convex, {2.8, -1.4}, {0.8, 1.6}});

  Environment<double> torsion = system({friction(4)}, diagonal({1, 1, 1, 1}), {-2, 0, 0, 0.5});
  torsion.mu = {0, 0.5, 0.5, 0.1};
  all.push_back(
      {"torsional friction of 0.1 * 2 brakes spin 0.5 to 0.3", torsion, Law::coulomb, {2, 0, 0, -0.2}, {0, 0, 0, 0.3}});

  // Unit mass sliding at 1 m/s, mu = 0.5, g dt = 0.0981 (advanced audit, item h). A block keeps to the ground under
  // the Coulomb law; the convex law lifts it by mu norm(w_t).
  const Environment<double> block = contact({1, 1, 1}, {-0.0981, 1, 0}, 0.5);
  all.push_back({"a sliding block, Coulomb", block, Law::coulomb, {0.0981, -0.04905, 0}, {0, 0.95095, 0}});
  all.push_back({"a sliding block, convex: n - 0.0981 = (1 - n / 2) / 2",
                 block,
                 Law::convex,
                 {0.47848, -0.23924, 0},
                 {0.38038, 0.76076, 0}});
  return all;
}

/// Every answer above, to `tolerance` in units of the numbers themselves, all of which are of order one; `iterations`
/// must do for that.
inline void expect_hand_answers(SolverKind solver, double tolerance, Index iterations) {
  for (const HandAnswer& hand : hand_answers()) {
    SCOPED_TRACE(hand.why + " (" + label(solver, hand.law) + ")");
    const Solution<double> solution = solve(batch_of({hand.env}, hand.law), options(solver, 1e-12, iterations));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << "residual " << solution.status[0].residual;
    for (std::size_t i = 0; i < hand.w.size(); ++i) {
      EXPECT_NEAR(solution.lambda[i], hand.lambda[i], tolerance) << "lambda of row " << i;
      EXPECT_NEAR(solution.w[i], hand.w[i], tolerance) << "w of row " << i;
    }
  }
}

}  // namespace stiction::test
