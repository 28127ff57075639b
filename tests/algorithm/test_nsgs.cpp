#include "core/algorithm/solver/nsgs.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "core/base/pack.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/one_cone.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::nsgs;

template <int M>
std::array<double, M> step_from_zero(const OneCone<double, M>& cone, const std::array<double, M>& q) {
  double y[M];
  for (std::size_t k = 0; k < M; ++k) y[k] = q[k];
  const auto step = exact_coulomb_step<M>(cone, 0, 0, y, 1.0);
  std::array<double, M> x;
  for (std::size_t k = 0; k < M; ++k) x[k] = step.d[k];
  return x;
}

/// Plain, strongly coupled, elliptic, and with fewer directions than rows.
const ConeRecipe kRecipes[] = {{1, 1, 0, 8},   {2, 1, 0.9, 8},   {2, 1, 0.99, 8}, {2, 1e3, 0.5, 8},
                               {2, 1, 0.5, 2}, {2, 1e3, 0.9, 3}, {0.3, 1, 0, 8}};

template <int M>
void expect_the_law_after_one_step() {
  scenes::Rng rng(7);
  int others = 0;
  for (const ConeRecipe& recipe : kRecipes) {
    int sliding = 0;
    for (int k = 0; k < 2000; ++k) {
      OneCone<double, M> cone;
      std::array<double, M> q;
      fill<M>(cone, q, recipe, rng);
      const std::array<double, M> x = step_from_zero<M>(cone, q);
      double point[M], pull = 0;
      for (std::size_t i = 0; i < M; ++i) point[i] = x[i];
      for (std::size_t i = 1; i < M; ++i) pull += x[i] * x[i];
      sliding += std::sqrt(pull) > 0.999999 * x[0];
      // Rounding: some ten products of numbers up to the scale, and eigenvalues raised to 2^-44 of the largest where B
      // is singular. Between the two, a step along a direction without stiffness can amplify it.
      ASSERT_LE(law_violation<M>(cone, q, point), 1e-11) << M << " rows, mu " << recipe.mu << ", coupling "
                                                         << recipe.coupling << ", rank " << recipe.rank << ", " << k;
    }
    EXPECT_GT(sliding, 200) << M << " rows, coupling " << recipe.coupling;
    others += 2000 - sliding;
  }
  EXPECT_GT(others, 200) << M;
}

TEST(ExactLocalSolve, OneStepFulfilsCoulombsLawOfOneContact) {
  expect_the_law_after_one_step<2>();
  expect_the_law_after_one_step<3>();
  expect_the_law_after_one_step<4>();
  expect_the_law_after_one_step<6>();
}

/// Finds all sliding solutions by walking round the circle of directions. x = r (1, u), r from w_n = 0, and w_t
/// against u where its part across u changes sign. The method looks for the multiplier, not for the direction.
std::vector<std::array<double, 3>> sliding_by_direction(const OneCone<double, 3>& cone,
                                                        const std::array<double, 3>& q) {
  struct Look {
    long double across, along, reaction;
    std::array<double, 3> x;
  };
  const auto look = [&](long double angle) {
    const long double u[] = {1, std::cos(angle), std::sin(angle)};
    long double image[3] = {};
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) image[i] += cone.B[i][j] * u[j];
    // Times the stiffness against (1, u), so that there are no poles: a trigonometric polynomial of degree two.
    const long double stiffness = image[0];
    const long double w[] = {q[1] * stiffness - q[0] * image[1], q[2] * stiffness - q[0] * image[2]};
    const long double r = -q[0] / stiffness;
    return Look{u[1] * w[1] - u[2] * w[0],
                (u[1] * w[0] + u[2] * w[1]) / stiffness,
                r,
                {static_cast<double>(r), static_cast<double>(r * u[1]), static_cast<double>(r * u[2])}};
  };
  std::vector<std::array<double, 3>> found;
  constexpr int kSteps = 20000;
  const long double circle = 2 * std::acos(-1.0L);
  for (int k = 0; k < kSteps; ++k) {
    long double left = circle * k / kSteps;
    long double right = circle * (k + 1) / kSteps;
    const bool rising = look(left).across < 0;
    if (rising == (look(right).across < 0)) continue;
    for (int halving = 0; halving < 60; ++halving) {
      const long double middle = (left + right) / 2;
      ((look(middle).across < 0) == rising ? left : right) = middle;
    }
    const Look at = look(left);
    if (at.reaction > 0 && at.along <= 0) found.push_back(at.x);
  }
  return found;
}

TEST(ExactLocalSolve, ASlidingStepIsOneOfThoseThatASearchOverAllDirectionsFinds) {
  scenes::Rng rng(11);
  int compared = 0;
  for (const ConeRecipe& recipe : {ConeRecipe{1, 1, 0, 8}, ConeRecipe{2, 1, 0.9, 8}, ConeRecipe{1, 10, 0.5, 8}})
    for (int k = 0; k < 15; ++k) {
      OneCone<double, 3> cone;
      std::array<double, 3> q;
      fill<3>(cone, q, recipe, rng);
      const std::array<double, 3> x = step_from_zero<3>(cone, q);
      if (std::hypot(x[1], x[2]) < x[0] * (1 - 1e-9)) continue;
      double nearest = 1e300;
      for (const auto& other : sliding_by_direction(cone, q)) {
        double away = 0;
        for (std::size_t i = 0; i < 3; ++i) away = std::max(away, std::abs(other[i] - x[i]));
        nearest = std::min(nearest, away);
      }
      EXPECT_LE(nearest, 1e-8 * x[0]) << "coupling " << recipe.coupling << ", case " << k;
      ++compared;
    }
  EXPECT_GT(compared, 15);
}

TEST(ExactLocalSolve, TheLanesOfAPackHaveTheBitsOfTheScalar) {
  constexpr int kLanes = 4;
  scenes::Rng rng(3);
  for (const ConeRecipe& recipe : kRecipes)
    for (int k = 0; k < 50; ++k) {
      using Wide = Pack<double, kLanes>;
      OneCone<Wide, 3> pack;
      Wide y[3];
      double expected[kLanes][3];
      for (int lane = 0; lane < kLanes; ++lane) {
        OneCone<double, 3> cone;
        std::array<double, 3> q;
        fill<3>(cone, q, recipe, rng);
        // Lanes that separate, stick and slide beside each other, and one that is padding.
        if (rng.chance(0.2)) q[0] = -q[0];
        if (rng.chance(0.1)) {
          cone.B = {};
          cone.normal_step = cone.tangential_step = {};
          q = {};
        }
        for (std::size_t i = 0; i < 3; ++i) {
          for (std::size_t j = 0; j < 3; ++j) pack.B[i][j].v[lane] = cone.B[i][j];
          pack.start[i].v[lane] = cone.start[i] = i == 0 ? 0.5 : 0.25;
          y[i].v[lane] = q[i];
        }
        pack.normal_step[0].v[lane] = cone.normal_step[0];
        pack.tangential_step[0].v[lane] = cone.tangential_step[0];
        double motion[] = {q[0], q[1], q[2]};
        const auto step = exact_coulomb_step<3>(cone, 0, 0, motion, 1.0);
        for (int i = 0; i < 3; ++i) expected[lane][i] = step.d[i];
      }
      const auto step = exact_coulomb_step<3>(pack, 0, 0, y, Wide(1.0));
      for (int lane = 0; lane < kLanes; ++lane)
        for (int i = 0; i < 3; ++i) EXPECT_EQ(step.d[i].v[lane], expected[lane][i]) << lane << ", " << i;
    }
}

TEST(ExactLocalSolve, AContactAtItsSolutionStaysThere) {
  scenes::Rng rng(5);
  for (int k = 0; k < 500; ++k) {
    OneCone<double, 3> cone;
    std::array<double, 3> q;
    fill<3>(cone, q, {1, 10, 0.5, 8}, rng);
    cone.start = step_from_zero<3>(cone, q);
    double y[3];
    for (std::size_t i = 0; i < 3; ++i) {
      y[i] = q[i];
      for (std::size_t j = 0; j < 3; ++j) y[i] += cone.B[i][j] * cone.start[j];
    }
    // The condition number of these blocks times rounding.
    for (const double d : exact_coulomb_step<3>(cone, 0, 0, y, 1.0).d)
      EXPECT_LE(std::abs(d), 1e-8 * cone.start[0]) << "case " << k;
  }
}

TEST(ExactLocalSolve, WithoutTangentialStiffnessFrictionGoesToItsBoundAgainstTheMotion) {
  OneCone<double, 3> cone;
  cone.B = {{{2, 0, 0}, {0, 0, 0}, {0, 0, 0}}};
  cone.set_steps();
  const std::array<double, 3> x = step_from_zero<3>(cone, {-4, 3, 4});
  EXPECT_DOUBLE_EQ(x[0], 2);
  EXPECT_NEAR(x[1], -1.2, 1e-12);
  EXPECT_NEAR(x[2], -1.6, 1e-12);
  // And with nothing to brake there is no reaction.
  EXPECT_EQ((step_from_zero<3>(cone, {-4, 0, 0})), (std::array<double, 3>{2, 0, 0}));
}

TEST(Nsgs, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-11, 2000);
}

TEST(Nsgs, OneContactTakesOneChunkWhateverItsBlock) {
  // pgs needs many sweeps on a block that is far from a multiple of the identity.
  Environment<double> env = system({friction(3)}, {2, 0.9, 0, 0.9, 1, 0.3, 0, 0.3, 5}, {-1, 3, -2});
  env.mu = {0, 0.8, 0.2};
  const Solution<double> solution = solve(batch_of({env}, Law::coulomb), options(kSolver, 1e-13, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
  EXPECT_EQ(solution.status[0].iterations, 4);
  EXPECT_GT(solve(batch_of({env}, Law::coulomb), options(SolverKind::pgs, 1e-13, 100)).status[0].iterations, 4);
}

TEST(Nsgs, UnderTheConvexLawItIsPgs) {
  Recipe recipe;
  recipe.seed = 4;
  const auto batch = batch_of({random_contacts(recipe)}, Law::convex);
  EXPECT_EQ(solve(batch, options(kSolver, 0, 9)).lambda, solve(batch, options(SolverKind::pgs, 0, 9)).lambda);
}

}  // namespace
