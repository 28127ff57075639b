#include "core/algorithm/solver/newton/newton.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/bits.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/machines/torture_cases.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/prepared.hpp"
#include "tests/support/systems/random_systems.hpp"

namespace stiction::test {
namespace {

using Params = MethodParams<double>;

/// Newton from inside: the system after every iteration until the method is finished.
template <Law kLaw, template <class> class SystemOf = Dense>
struct Iterated {
  Prepared<Newton, kLaw, SystemOf> prepared;
  Index iterations = 0;
  std::vector<double> residuals;  ///< after each iteration

  explicit Iterated(const Environment<double>& env, Index limit = 100, const std::vector<double>& warm = {})
      : prepared(env, warm) {
    auto& s = prepared.system();
    EXPECT_TRUE(is_solvable(prepared.flags)) << prepared.flags;
    while (iterations < limit && s.scalar[kOutcome] == double(kRunning)) {
      Newton::iterate<kLaw>(prepared.team, s, Params{1.0});
      update_best<Newton, kLaw>(prepared.team, s, true);
      residuals.push_back(s.scalar[kLastResidual]);
      ++iterations;
    }
    write_solution(prepared.team, prepared.env, s);
    absolute = final_residual_of(prepared).residual;
  }
  double absolute = 0.0;

  [[nodiscard]] bool is_finished() { return prepared.system().scalar[kOutcome] == double(kFinished); }
  [[nodiscard]] bool is_primal() { return prepared.system().scalar[kProximalWeight] == 0.0; }
  [[nodiscard]] Index iterations_to(double tolerance) const {
    for (std::size_t k = 0; k < residuals.size(); ++k)
      if (residuals[k] <= tolerance) return static_cast<Index>(k) + 1;
    return 1000;
  }
};

template <Law kLaw>
void expect_hand_answer(const HandAnswer& hand) {
  Iterated<kLaw> run(hand.env);
  EXPECT_LT(run.absolute, 1e-11);
  for (std::size_t i = 0; i < hand.w.size(); ++i) {
    EXPECT_NEAR(run.prepared.env.lambda[i], hand.lambda[i], 1e-11) << "lambda of row " << i;
    EXPECT_NEAR(run.prepared.env.w[i], hand.w[i], 1e-11) << "w of row " << i;
  }
}
TEST(Newton, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  for (const HandAnswer& hand : hand_answers()) {
    SCOPED_TRACE(hand.why);
    if (hand.law == Law::convex) {
      expect_hand_answer<Law::convex>(hand);
    } else {
      expect_hand_answer<Law::coulomb>(hand);
    }
  }
}

TEST(Newton, ThePublicSolverHasTheAnswersWorkedOutByHand) {
  expect_hand_answers(SolverKind::newton, 1e-11, 100);
}

TEST(Newton, ComplianceThatIsPartOfTheMotionIsTakenOutOfTheMatrix) {
  // A = 1, R = 1: a pressed row has lambda = 2 / 2, and the primal problem's zeta is lambda itself.
  Environment<double> env = contact({1, 1, 1}, {-2, 0.25, 0}, 0.5);
  env.R = {1, 1, 1};
  Iterated<Law::convex> run(env);
  EXPECT_TRUE(run.is_primal());
  EXPECT_TRUE(run.is_finished());
  EXPECT_NEAR(run.prepared.env.lambda[0], 1.0, 1e-14);
  EXPECT_NEAR(run.prepared.env.lambda[1], -0.125, 1e-14);
}

Recipe recipe_of(std::uint64_t seed, double rank, double compliance) {
  Recipe recipe;
  recipe.seed = seed;
  recipe.contacts = 4;
  recipe.others = 3;
  recipe.rank = rank;
  recipe.compliance = compliance;
  return recipe;
}

TEST(Newton, CompliantSystemsAreSolvedToRoundingInFewIterationsEvenIfTheyAreSingular) {
  for (const double rank : {1.5, 0.5})
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      SCOPED_TRACE(testing::Message() << "rank " << rank << ", seed " << seed);
      const Environment<double> env = random_contacts(recipe_of(seed, rank, 0.01));
      Iterated<Law::convex> run(env);
      ASSERT_TRUE(run.is_primal());
      EXPECT_TRUE(run.is_finished());
      EXPECT_LT(run.absolute, 1e-11);
      EXPECT_LE(run.iterations_to(1e-8), 12);
      const oracle::Answer truth = oracle::solve_convex(env);
      ASSERT_TRUE(truth.converged);
      // With R > 0 the answer is unique. R over the diagonal is 0.01, and tangential rows have mu >= 0.1: the residual
      // of either is amplified by some 1e4.
      for (std::size_t i = 0; i < env.b.size(); ++i)
        EXPECT_NEAR(run.prepared.env.w[i], truth.w[i], 1e-7) << "row " << i;
    }
}

TEST(Newton, TheLineSearchMakesItConvergeFromAnyWarmStart) {
  const Environment<double> env = random_contacts(recipe_of(3, 0.5, 0.01));
  std::vector<double> wild(env.b.size());
  for (std::size_t i = 0; i < wild.size(); ++i) wild[i] = (i % 2 == 0 ? 1e4 : -1e4) * static_cast<double>(i + 1);
  Iterated<Law::convex> run(env, 100, wild);
  EXPECT_TRUE(run.is_finished());
  EXPECT_LT(run.absolute, 1e-10);
}

TEST(Newton, TheAnswerAsWarmStartIsWhereItStays) {
  const Environment<double> env = random_contacts(recipe_of(5, 1.5, 0.01));
  const oracle::Answer truth = oracle::solve_convex(env);
  Iterated<Law::convex> run(env, 100, truth.lambda);
  EXPECT_LE(run.iterations_to(1e-8), 1);
}

TEST(Newton, RigidSystemsGoByTheNaturalMap) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    const Environment<double> env = random_contacts(recipe_of(seed, 1.5, 0.0));
    Iterated<Law::convex> run(env);
    EXPECT_FALSE(run.is_primal());
    EXPECT_LT(run.absolute, 1e-11);
    EXPECT_LE(run.iterations_to(1e-8), 12);
  }
}

TEST(Newton, WhereCoulombsSolutionIsUniqueItIsTheOracles) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    Recipe recipe = recipe_of(seed, 1.5, 0.0);
    recipe.mu_max = 0.3;
    const Environment<double> env = random_conditioned(recipe, 9.0);
    Iterated<Law::coulomb> run(env);
    EXPECT_LT(run.absolute, 1e-11);
    EXPECT_LE(run.iterations_to(1e-8), 12);
    const oracle::Answer truth = oracle::solve_coulomb(env);
    ASSERT_TRUE(truth.converged);
    for (std::size_t i = 0; i < env.b.size(); ++i) EXPECT_NEAR(run.prepared.env.w[i], truth.w[i], 1e-7) << "row " << i;
  }
}

TEST(Newton, TheSparseSystemHasTheSameAnswer) {
  for (const double compliance : {0.01, 0.0}) {
    const Environment<double> env = random_contacts(recipe_of(2, 1.5, compliance));
    Iterated<Law::convex> dense(env);
    Iterated<Law::convex, SparseSystem> sparse(env);
    for (std::size_t i = 0; i < env.b.size(); ++i)
      EXPECT_NEAR(dense.prepared.env.w[i], sparse.prepared.env.w[i], 1e-9) << "row " << i;
  }
}

TEST(Newton, NothingIsNotANumberWhereBoundsMeetFrictionIsAbsentOrNothingMoves) {
  Environment<double> env =
      system({friction(3), box(), free_row()},
             {1, 0, 0, .1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, .1, 0, 0, 1, 0, 0, 0, 0, 0, 1}, {-1, 1, 1, -1, 1});
  env.mu = {0, 0, 0.5, 0, 0};
  env.lo = {0, 0, 0, 0.25, 0};
  env.hi = {0, 0, 0, 0.25, 0};
  for (const double R : {0.0, 1e-300, 0.1})
    for (const double b : {0.0, 1.0}) {
      Environment<double> one = env;
      one.R.assign(5, R);
      for (double& entry : one.b) entry *= b;
      Iterated<Law::convex> convex(one, 20);
      Iterated<Law::coulomb> coulomb(one, 20);
      EXPECT_LT(convex.absolute, 1e-12) << R;
      EXPECT_LT(coulomb.absolute, 1e-12) << R;
      for (std::size_t i = 0; i < 5; ++i) {
        EXPECT_TRUE(std::isfinite(convex.prepared.env.lambda[i]));
        EXPECT_TRUE(std::isfinite(coulomb.prepared.env.lambda[i]));
      }
    }
}

void expect_same_bits_on_teams(const Environment<double>& env, Law law, EnvPath path) {
  const ContactBatch<double> batch = batch_of({env}, law);
  ASSERT_EQ(make_plan(batch.view()).path[0], path);
  const SolverOptions o = options(SolverKind::newton, 1e-14, 4);
  const Solution<double> alone = solve_alone(batch, o);
  for (const Index width : {2, 3, 8, 33}) EXPECT_TRUE(same_bits(alone, solve_on_teams(batch, o, width))) << width;
}
TEST(Newton, TheNumberOfLanesChangesNoBit) {
  for (const double compliance : {0.01, 0.0})
    for (const Law law : kBothLaws) {
      expect_same_bits_on_teams(random_contacts(recipe_of(7, 0.6, compliance)), law, EnvPath::dense);
      Environment<double> stack = small_sparse();
      stack.R.assign(stack.b.size(), compliance);
      expect_same_bits_on_teams(stack, law, EnvPath::sparse);
    }
}

}  // namespace
}  // namespace stiction::test
