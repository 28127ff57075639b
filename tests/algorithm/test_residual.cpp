#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/solver/pgs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/plan/plan.hpp"
#include "scenes/rng.hpp"
#include "stiction/residual.hpp"
#include "stiction/solver.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// The algorithm's final residual of a given lambda: absolute, and the motion it wrote.
template <Law kLaw>
double body_residual(const Environment<double>& env, const std::vector<double>& lambda,
                     std::vector<double>* w = nullptr) {
  Prepared<Pgs, kLaw, Dense> p(env);
  for (std::size_t i = 0; i < lambda.size(); ++i) p.env.lambda[i] = lambda[i];
  const double result = final_residual_of(p).absolute;
  if (w != nullptr) w->assign(p.env.w, p.env.w + p.env.n);
  return result;
}

/// `size`: of the numbers whose roundings the residual is made of, 0: its own [w]. `what`: names the reactions.
template <Law kLaw>
void expect_the_judges_residual(const Environment<double>& env, const std::vector<double>& lambda, double size,
                                const std::string& what) {
  const double judged = verify(batch_of({env}, kLaw).view(), std::span<const double>(lambda)).at(0).absolute;
  EXPECT_NEAR(body_residual<kLaw>(env, lambda), judged, 1e-12 * std::max(judged, size)) << what;
}

/// Reactions drawn at random, which no contact's law allows. Then those of a few sweeps, near one of its members: open,
/// sticking, or sliding.
template <Law kLaw>
void expect_the_judges_residuals(std::uint64_t seed) {
  Recipe recipe;
  recipe.seed = seed;
  const Environment<double> env = random_contacts(recipe);
  scenes::Rng rng(seed + 1000);
  std::vector<double> lambda;
  for (std::size_t i = 0; i < env.b.size(); ++i) lambda.push_back(rng.symmetric(1.0));
  // Frictionless axes carry nothing in any answer, and a reaction on one is a penalty of the judge alone.
  std::size_t row = 0;
  for (const auto& cone : env.cones) {
    for (std::size_t k = 1; k < static_cast<std::size_t>(cone.row_count); ++k)
      if (env.mu[row + k] == 0) lambda[row + k] = 0;
    row += static_cast<std::size_t>(cone.row_count);
  }
  expect_the_judges_residual<kLaw>(env, lambda, 0.0, "seed " + std::to_string(seed));
  const auto swept = solve(batch_of({env}, kLaw), options(SolverKind::pgs, 0.0, 8));
  double largest = 0;
  for (const double b : env.b) largest = std::max(largest, std::abs(b));
  expect_the_judges_residual<kLaw>(env, swept.lambda, largest, "seed " + std::to_string(seed) + ", swept");
}

TEST(ResidualBody, AgreesWithTheJudgeOnAnyReactions) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    expect_the_judges_residuals<Law::convex>(seed);
    expect_the_judges_residuals<Law::coulomb>(seed);
  }
}

TEST(ResidualBody, TheSolutionsWorkedOutByHandHaveNone) {
  const auto env = contact({1, 1, 1}, {-2, 3, 0}, 0.5);
  EXPECT_NEAR(body_residual<Law::coulomb>(env, {2, -1, 0}), 0, 1e-15);
  EXPECT_GT(body_residual<Law::convex>(env, {2, -1, 0}), 0.1);
  EXPECT_NEAR(body_residual<Law::convex>(env, {2.8, -1.4, 0}), 0, 1e-15);
  EXPECT_GT(body_residual<Law::coulomb>(env, {2.8, -1.4, 0}), 0.1);
  const auto sticking = contact({1, 1, 1}, {-2, 0.6, 0}, 0.5), open = contact({1, 1, 1}, {3, 1, 0}, 0.5);
  EXPECT_NEAR(body_residual<Law::coulomb>(sticking, {2, -0.6, 0}), 0, 1e-15);
  EXPECT_NEAR(body_residual<Law::convex>(sticking, {2, -0.6, 0}), 0, 1e-15);
  EXPECT_EQ(body_residual<Law::coulomb>(open, {0, 0, 0}), 0);
  EXPECT_EQ(body_residual<Law::convex>(open, {0, 0, 0}), 0);
}

TEST(ResidualBody, WritesTheMotionOfTheReactionsItWasGiven) {
  std::vector<double> w;
  body_residual<Law::convex>(system({unilateral(), free_row()}, {2, 1, 1, 4}, {-3, 1}), {1, -1}, &w);
  EXPECT_EQ(w, (std::vector<double>{-2, -2}));
}

/// The error of a cone with d = 1 in every row and mu = 1.
template <Law kLaw, ConeKind kKind, int kRows>
double unit_error(const double (&x)[kRows], const double (&y)[kRows]) {
  ConeMetric<double, kRows> metric;
  metric.a = 1.0;
  for (int k = 0; k < kRows; ++k) metric.press[k] = metric.slip[k] = 1.0;
  return std::sqrt(law_error_square<kLaw>(ConeShape<kKind, kRows>{}, x, y, metric, 0.0, 0.0));
}

TEST(ResidualBody, NothingThatIsNotFiniteLooksSmall) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), infinity, -infinity}) {
    const double x[] = {0.0, bad, 0.0};
    const double y[] = {1.0, 0.0, 0.0};
    EXPECT_EQ((unit_error<Law::convex, ConeKind::friction>(x, y)), infinity);
    EXPECT_EQ((unit_error<Law::convex, ConeKind::friction>(y, x)), infinity);
    EXPECT_EQ((unit_error<Law::coulomb, ConeKind::friction>(y, x)), infinity);
    const double one[] = {0.0}, other[] = {bad};
    EXPECT_EQ((unit_error<Law::convex, ConeKind::unilateral>(one, other)), infinity);
  }
}

TEST(ResidualBody, AnOpenContactObeysCoulombsLawHoweverFastItSlides) {
  const double x[] = {0.0, 0.0, 0.0};
  const double y[] = {1.0, 1e150, -1e150};
  EXPECT_EQ((unit_error<Law::coulomb, ConeKind::friction>(x, y)), 0.0);
}

TEST(ResidualBody, ANormThatVanishesIsNotZero) {
  // The squares of the sliding vanish. The convex law forbids it without lifting off, so a norm of 0 would pass.
  const auto env = contact({1, 1, 1}, {1e-226, 1e-225, 0}, 1);
  EXPECT_GT(body_residual<Law::convex>(env, {0, 0, 0}), 6e-226);
  EXPECT_LT(body_residual<Law::coulomb>(env, {0, 0, 0}), 1e-159) << "an open contact may slide";
  EXPECT_GT(body_residual<Law::coulomb>(contact({1, 1, 1}, {-1e-225, 1e-225, 0}, 1), {0, 0, 0}), 9e-226);
  const auto lifting = contact({1, 1, 1}, {1e-160, 1e-225, 0}, 1);
  EXPECT_LT(body_residual<Law::convex>(lifting, {0, 0, 0}), 1e-159);
  ContactBatch<double> batch(Law::convex);
  batch.add(env);
  for (const SolverKind solver : kEverySolver) {
    if (solver == SolverKind::lemke) continue;
    SCOPED_TRACE(to_string(solver));
    const auto solution = solve(batch, options(solver, 0.0, 5));
    const double judged = verify(batch.view(), std::span<const double>(solution.lambda))[0].absolute;
    EXPECT_TRUE(solution.status[0].code != EnvCode::solved || judged == 0.0) << judged;
  }
}

TEST(ResidualBody, AnAxisFarLighterThanItsNormalHasFriction) {
  // A fuzzer's: the weight of such an axis has no inverse, and it passed for one without friction.
  for (const double normal : {1e40, 1e290, 1e303, 1.7e308})
    for (const double mu : {1e-3, 1.0}) {
      SCOPED_TRACE(::testing::Message() << normal << ", mu " << mu);
      const auto env = contact({normal, 1, 1}, {-3, 8, 0}, mu);
      EXPECT_GT(body_residual<Law::convex>(env, {3 / normal, 0, 0}), 0.9 * 8 * mu) << "the cone lifts what slides";
      ContactBatch<double> batch(Law::convex);
      batch.add(env);
      for (const SolverKind solver : kEverySolver) {
        if (solver == SolverKind::lemke) continue;
        const auto solution = solve(batch, options(solver, 1e-4, 50));
        const double judged = verify(batch.view(), std::span<const double>(solution.lambda))[0].relative;
        EXPECT_TRUE(solution.status[0].code != EnvCode::solved || judged <= 1.5e-4) << to_string(solver) << judged;
      }
    }
}

TEST(ResidualBody, FrictionWhoseSquareHasNoInverseIsNone) {
  // A fuzzer's: it sticks along one axis and slides along the other, which has next to no friction.
  for (const double mu : {1e-305, 0.0}) {
    auto env = contact({1, 1, 1}, {-2, 0.3, 4}, 0.5);
    env.mu[2] = mu;
    EXPECT_NEAR(body_residual<Law::coulomb>(env, {2, -0.3, 0}), 0, 1e-15) << mu;
    expect_the_judges_residual<Law::coulomb>(env, {2, -0.3, 0}, 4.0, "sticks and slides");
  }
}

TEST(ResidualBody, NoReactionIsMissedInARowThatNoneMoves) {
  // It slides with (3, 4), of which its reactions change the first alone. The judge asked for one along the other.
  const auto env = contact({1, 1, 0}, {-2, 3.6, 4}, 0.5);
  for (const double along : {0.0, -0.8}) {
    EXPECT_NEAR(body_residual<Law::coulomb>(env, {2, -0.6, along}), 0, 1e-15) << along;
    expect_the_judges_residual<Law::coulomb>(env, {2, -0.6, along}, 4.0, "slides");
  }
  EXPECT_GT(body_residual<Law::coulomb>(env, {2, 0, 0}), 0.1) << "friction that would change the motion is missed";
  expect_the_judges_residual<Law::coulomb>(env, {2, 0, 0}, 4.0, "does not resist");
}

TEST(ResidualBody, WhatItCannotSeeIsNotSolvedWhateverIsAllowed) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  const auto relative = [](double residual, double floor, double tolerance) {
    return judge<double>({residual, 0.0, residual, floor, 0.0}, 1.0, {tolerance, 0.0}).relative;
  };
  EXPECT_EQ(relative(0.0, kInfinite, kInfinite), kInfinite);
  EXPECT_EQ(relative(0.0, kInfinite, 0.0), kInfinite);
  EXPECT_EQ(relative(1.0, 3.0, 2.0), 3.0) << "roundings hide more than is allowed";
  EXPECT_EQ(relative(1.0, 3.0, 4.0), 1.0);
  const Verdict beyond = judge<double>({0.0, kInfinite, kInfinite, 0.0, 0.0}, 1.0, {1e30, 0.0});
  EXPECT_FALSE(beyond.is_final()) << "reactions that are no numbers beside a contact that cannot move";
  EXPECT_FALSE(judge<double>({1.0, 0.0, kInfinite, 0.0, 0.0}, 1.0, {2.0, 0.0}).is_solved);
  // A fuzzer's: de Saxce's term overflows, and so does the tolerance times max|b|, so that one was held against the
  // other.
  ContactBatch<double> batch(Law::coulomb);
  batch.add(contact({1e161, 1e161, 1e161}, {-1e161, 9e161, 9e161}, 1));
  ContactBatchView<double> view = batch.view();
  const double tolerance = 1e214;
  view.env_tolerance = &tolerance;
  for (const SolverKind solver : kEverySolver) {
    if (solver == SolverKind::lemke) continue;
    SCOPED_TRACE(to_string(solver));
    std::vector<double> lambda(3), w(3);
    EnvStatus status{};
    Solver(Device::cpu(), options(solver, 0.0, 5)).solve(view, {lambda.data(), w.data(), &status});
    const double judged = verify(view, std::span<const double>(lambda))[0].absolute;
    EXPECT_TRUE(status.code != EnvCode::solved || status.residual_absolute >= 0.5 * judged)
        << status.residual_absolute << " for " << judged;
  }
}

TEST(ResidualBody, RoundingsOfReactionsEndASearch) {
  const auto verdict = [](double residual, double reaction, double tolerance) {
    return judge<float>({residual, 0.0, residual, 0.0, reaction}, 1.0, {tolerance, 0.0});
  };
  EXPECT_TRUE(verdict(2e-6, 100.0, 1e-6).is_rounding) << "2^-24 of 100 is 6e-6";
  EXPECT_EQ(verdict(2e-6, 100.0, 1e-6).code(EnvCode::stalled), EnvCode::rounding);
  EXPECT_FALSE(verdict(2e-4, 100.0, 1e-6).is_rounding) << "more is left than roundings";
  EXPECT_FALSE(verdict(2e-6, 1.0, 1e-6).is_rounding) << "roundings are less than is allowed";
  EXPECT_FALSE(verdict(2e-6, 100.0, 0.0).is_rounding) << "every iteration was asked for";
  EXPECT_EQ(verdict(5e-7, 100.0, 1e-6).code(EnvCode::stalled), EnvCode::solved);
}

TEST(ResidualBody, ItsScaleIsThatOfTheLargestIsland) {
  Prepared<Pgs, Law::convex, Dense> p(system({free_row(), free_row()}, {1, 0, 0, 1}, {-3, 2}));
  EXPECT_EQ(error_scale_of(p.system()).largest, 3.0);
  EXPECT_EQ(p.system().island[0], 1.0);
  EXPECT_EQ(p.system().island[1], 1.5);
  // Contacts that open need nothing: a ten-thousandth of their motion.
  Prepared<Pgs, Law::coulomb, Dense> open(contact({1, 1, 1}, {2, 4, 0}, 1));
  EXPECT_NEAR(error_scale_of(open.system()).largest, 4e-4, 1e-10);
  Prepared<Pgs, Law::convex, Dense> coupled(system({free_row(), free_row()}, {1, 0.5, 0.5, 1}, {-3, 2}));
  EXPECT_EQ(coupled.system().island[1], 1.0);
}

/// Two chains of contacts, each pressed at one end, whose numbers are shuffled: pressed by 1 and by 1e-3.
Environment<double> shuffled_chains(std::size_t length) {
  std::vector<std::size_t> row_at(2 * length);
  std::iota(row_at.begin(), row_at.end(), std::size_t{0});
  scenes::Rng rng(7);
  for (std::size_t i = row_at.size(); --i > 0;)
    std::swap(row_at[i], row_at[static_cast<std::size_t>(rng.uniform(0.0, 0.999999) * static_cast<double>(i + 1))]);
  std::vector<std::map<std::size_t, double>> entries(row_at.size());
  Environment<double> env;
  env.b.resize(row_at.size());
  for (std::size_t at = 0; at < row_at.size(); ++at) {
    auto& row = entries[row_at[at]];
    row[row_at[at]] = 2.1;
    if (at % length > 0) row[row_at[at - 1]] = -1.0;
    if (at % length + 1 < length) row[row_at[at + 1]] = -1.0;
    env.b[row_at[at]] = at == 0 ? -1.0 : at == length ? -1e-3 : 0.0;
  }
  for (const auto& row : entries) {
    env.cones.push_back(unilateral());
    for (const auto& [column, value] : row) {
      env.column.push_back(static_cast<Index>(column));
      env.A.push_back(value);
    }
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
  }
  return env;
}

TEST(ResidualBody, ScalesReachTheEndsOfChainsWhoseContactsStandInAnyOrder) {
  const auto batch = batch_of({shuffled_chains(2000)});
  ASSERT_EQ(make_plan(batch.view()).path[0], EnvPath::sparse);
  const auto solution = solve(batch, options(SolverKind::pgs, 0.0, 3));
  const auto judged = verify(batch.view(), std::span<const double>(solution.lambda));
  EXPECT_GT(judged[0].relative, 1e-3);
  EXPECT_LT(judged[0].relative, 0.5) << "sweeps that a residual calls worse than nothing are not returned";
  EXPECT_NEAR(solution.status[0].residual, judged[0].relative, 1e-12);
}

}  // namespace
