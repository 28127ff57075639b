#include "core/algorithm/solver/lemke/lemke.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "scenes/rng.hpp"
#include "stiction/residual.hpp"
#include "tests/support/machines/solve_alone.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/systems/prepared.hpp"

namespace stiction::test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Solution<double> pivot(const Environment<double>& env, double tolerance = 1e-12, Index pivots = 1000) {
  return solve_alone(batch_of({env}), options(SolverKind::lemke, tolerance, pivots));
}

double judged(const Environment<double>& env, const std::vector<double>& lambda) {
  const auto batch = batch_of({env});
  return verify(batch.view(), std::span<const double>(lambda)).at(0).relative;
}

bool has_friction(const Environment<double>& env) {
  return std::any_of(env.cones.begin(), env.cones.end(),
                     [](const Cone& cone) { return cone.kind == ConeKind::friction; });
}

TEST(Lemke, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  for (const HandAnswer& hand : hand_answers()) {
    if (has_friction(hand.env)) continue;
    SCOPED_TRACE(hand.why);
    const Solution<double> solution = pivot(hand.env);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << "residual " << solution.status[0].residual;
    for (std::size_t i = 0; i < hand.w.size(); ++i) {
      EXPECT_NEAR(solution.lambda[i], hand.lambda[i], 1e-14) << "lambda of row " << i;
      EXPECT_NEAR(solution.w[i], hand.w[i], 1e-14) << "w of row " << i;
    }
  }
}

TEST(Lemke, NoPathBeginsAtTheRowOfAReaction) {
  // A fuzzer's: x_1 is basic and above its upper bound, so it needs x_0. It was taken for a motion.
  Prepared<Lemke, Law::convex, Dense> p(system({box(), box()}, {2, 1, 1, 2}, {-1, -1}));
  const Tableau t(p.system());
  std::fill(t.column, &t.T(0, 0), 1.0);  // whatever lies before the table
  const double lo[] = {-kInfinity, -kInfinity}, hi[] = {kInfinity, -10};
  const double wanted[] = {0, 1};
  write_dictionary(p.team, p.system(), t);
  for (Index j = 0; j < 2; ++j) {
    t.lo[j] = lo[j];
    t.hi[j] = hi[j];
    t.side[j] = 0.0;
  }
  write_values(p.team, p.system(), t);
  bring_in(p.team, t, wanted);
  ASSERT_TRUE(t.is_basic(1));
  ASSERT_EQ(first_blocking(p.team, t, 0, -1.0, true).row, t.row_of(1));
  const std::vector<double> before(&t.T(0, 0), &t.T(0, 0) + 8), rows(t.basic, t.basic + 2);
  EXPECT_FALSE(begin_at_pair(p.team, t, 0));
  EXPECT_EQ(std::vector<double>(&t.T(0, 0), &t.T(0, 0) + 8), before);
  EXPECT_EQ(std::vector<double>(t.basic, t.basic + 2), rows);
}

TEST(Lemke, AFrictionConeIsRefusedByName) {
  for (const Index rows : {2, 3, 6}) {
    const auto n = static_cast<std::size_t>(rows);
    const Solution<double> solution =
        pivot(system({friction(rows)}, diagonal(std::vector<double>(n, 1.0)), std::vector<double>(n, -1.0)));
    EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
    EXPECT_EQ(solution.status[0].flags, kFlagUnsupportedCone);
    EXPECT_EQ(solution.lambda, std::vector<double>(n, 0.0));
  }
}

TEST(Lemke, ZerosOnTheDiagonalAreNoObstacle) {
  // Optimality conditions of a quadratic and of a linear programme, worked out by hand.
  const Environment<double> quadratic = system({unilateral(), unilateral()}, {2, -1, 1, 0}, {-2, -3});
  const Environment<double> programme = system({unilateral(), unilateral()}, {0, -1, 1, 0}, {3, -2});
  EXPECT_EQ(pivot(quadratic).lambda, (std::vector<double>{3, 4}));
  EXPECT_EQ(pivot(programme).lambda, (std::vector<double>{2, 3}));
  for (const auto& env : {quadratic, programme}) {
    const auto batch = batch_of({env});
    EXPECT_FALSE(validate(batch.view()).empty()) << "sweeps cannot take them";
    EXPECT_TRUE(validate(batch.view(), 64, SolverKind::lemke).empty());
    const Solution<double> chosen = solve(batch, options(SolverKind::automatic, 1e-12, 100));
    EXPECT_EQ(chosen.status[0].code, EnvCode::solved);
    EXPECT_EQ(chosen.status[0].solver, SolverKind::lemke);
    EXPECT_EQ(chosen.lambda, pivot(env).lambda);
    SolverOptions sweeps = options(SolverKind::npgs, 1e-6, 100);
    sweeps.invalid = InvalidPolicy::isolate;
    EXPECT_EQ(solve(batch, sweeps).status[0].flags, kFlagBadDiagonal);
  }
}

TEST(Lemke, AReactionOnARowWithoutADiagonalWeighsNothing) {
  // w = 2 on the first row, whatever its reaction is.
  const Environment<double> env = system({unilateral(), unilateral()}, {0, 0, 0, 1}, {2, 1});
  EXPECT_EQ(judged(env, {0, 0}), 0.0);
  EXPECT_EQ(judged(env, {1, 0}), 0.0);
  EXPECT_EQ(judged(system({unilateral(), unilateral()}, {0, 0, 0, 1}, {-2, 1}), {1, 0}), 1.0);
}

/// Solves B u = q of any number of right-hand sides in long double, by partial pivoting; false where B is singular.
bool solve_square(std::vector<std::vector<long double>> B, std::vector<long double>& q) {
  const std::size_t n = q.size();
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t best = k;
    for (std::size_t i = k; i < n; ++i)
      if (std::abs(B[i][k]) > std::abs(B[best][k])) best = i;
    if (std::abs(B[best][k]) < 1e-12L) return false;
    std::swap(B[k], B[best]);
    std::swap(q[k], q[best]);
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k) continue;
      const long double factor = B[i][k] / B[k][k];
      for (std::size_t j = k; j < n; ++j) B[i][j] -= factor * B[k][j];
      q[i] -= factor * q[k];
    }
  }
  for (std::size_t k = 0; k < n; ++k) q[k] /= B[k][k];
  return true;
}

/// Every basic solution of a system of free, unilateral and box rows. Each row is at its lower bound with w >= 0, at
/// its upper one with w <= 0, or between them with w = 0.
std::vector<std::vector<double>> enumerate(const Environment<double>& env) {
  const std::size_t n = env.b.size();
  const auto a = oracle::detail::dense_matrix(env);
  std::size_t combinations = 1;
  for (std::size_t i = 0; i < n; ++i) combinations *= 3;
  std::vector<std::vector<double>> found;
  for (std::size_t number = 0; number < combinations; ++number) {
    std::vector<int> state(n);
    std::size_t rest = number;
    for (int& s : state) {
      s = static_cast<int>(rest % 3);
      rest /= 3;
    }
    std::vector<std::vector<long double>> B(n, std::vector<long double>(n, 0));
    std::vector<long double> lo(n), hi(n), u(n), x(n, 0);
    bool is_possible = true;
    for (std::size_t i = 0; i < n; ++i) {
      const ConeKind kind = env.cones[i].kind;
      lo[i] = kind == ConeKind::free ? -kInfinity : kind == ConeKind::box ? env.lo[i] : 0.0;
      hi[i] = kind == ConeKind::box ? env.hi[i] : kInfinity;
      is_possible = is_possible && (state[i] == 0 || std::isfinite(state[i] == 1 ? lo[i] : hi[i]));
      if (state[i] != 0) x[i] = state[i] == 1 ? lo[i] : hi[i];
    }
    if (!is_possible) continue;
    for (std::size_t i = 0; i < n; ++i) {
      u[i] = -static_cast<long double>(env.b[i]);
      for (std::size_t j = 0; j < n; ++j) {
        if (state[j] == 0) {
          B[i][j] = a[i * n + j];
        } else {
          u[i] -= a[i * n + j] * x[j];
          B[i][j] = i == j ? -1 : 0;
        }
      }
    }
    if (!solve_square(B, u)) continue;
    bool is_solution = true;
    std::vector<double> lambda(n);
    for (std::size_t i = 0; i < n; ++i) {
      constexpr long double kRounding = 1e-13L;
      if (state[i] == 0) {
        is_solution = is_solution && u[i] >= lo[i] - kRounding && u[i] <= hi[i] + kRounding;
        x[i] = u[i];
      } else {
        is_solution = is_solution && (state[i] == 1 ? u[i] >= -kRounding : u[i] <= kRounding);
      }
      lambda[i] = static_cast<double>(x[i]);
    }
    if (is_solution) found.push_back(lambda);
  }
  return found;
}

/// Rows of random kinds with random bounds, some infinite, some equal.
Environment<double> random_rows(scenes::Rng& rng, std::size_t n) {
  Environment<double> env;
  for (std::size_t i = 0; i < n; ++i) {
    env.cones.push_back({static_cast<ConeKind>(rng.below(3)), 1, -1});
    const double width = rng.chance(0.1) ? 0.0 : rng.uniform(0.1, 1.0);
    const double lo = rng.symmetric(0.5);
    env.lo.push_back(rng.chance(0.2) ? -kInfinity : lo);
    env.hi.push_back(rng.chance(0.2) ? kInfinity : lo + width);
    env.b.push_back(rng.symmetric(1.0));
  }
  return env;
}

/// G G' of n x rank numbers plus a skew part plus shift on the diagonal; any scaling of rows and columns.
std::vector<double> random_matrix(scenes::Rng& rng, std::size_t n, std::size_t rank, double skew, double shift) {
  std::vector<double> G(n * rank), A(n * n, 0.0);
  for (double& g : G) g = rng.symmetric(1.0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t k = 0; k < rank; ++k) A[i * n + j] += G[i * rank + k] * G[j * rank + k];
      if (i == j) A[i * n + j] += shift;
    }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const double part = rng.symmetric(skew);
      A[i * n + j] += part;
      A[j * n + i] -= part;
    }
  return A;
}

TEST(Lemke, PositiveDefiniteSystemsHaveTheOneSolutionOfAllCombinationsSymmetricOrNot) {
  scenes::Rng rng(11);
  for (int trial = 0; trial < 120; ++trial) {
    const auto n = static_cast<std::size_t>(1 + rng.below(6));
    Environment<double> env = random_rows(rng, n);
    env.set_dense(random_matrix(rng, n, n, trial % 2 == 0 ? 0.0 : 2.0, 0.1), static_cast<Index>(n));
    const auto all = enumerate(env);
    // Degenerate bounds give the same point by several bases.
    ASSERT_FALSE(all.empty()) << trial;
    const Solution<double> solution = pivot(env, 1e-11);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << trial << ", residual " << solution.status[0].residual;
    for (std::size_t i = 0; i < n; ++i) {
      EXPECT_NEAR(solution.lambda[i], all.front()[i], 1e-9) << "trial " << trial << ", row " << i;
      EXPECT_NEAR(all.back()[i], all.front()[i], 1e-9) << "a positive definite system has one solution";
    }
  }
}

TEST(Lemke, UnilateralRowsHaveASolutionThatTheOracleFinds) {
  scenes::Rng rng(5);
  for (int trial = 0; trial < 60; ++trial) {
    const auto n = static_cast<std::size_t>(2 + rng.below(7));
    Environment<double> env;
    env.cones.assign(n, unilateral());
    for (std::size_t i = 0; i < n; ++i) env.b.push_back(rng.symmetric(1.0));
    env.set_dense(random_matrix(rng, n, n, 1.0, 0.05), static_cast<Index>(n));
    const auto all = oracle::solve_lcp_by_enumeration(env);
    ASSERT_EQ(all.size(), 1U);
    const Solution<double> solution = pivot(env, 1e-11);
    for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(solution.lambda[i], all[0].lambda[i], 1e-9) << trial;
  }
}

TEST(Lemke, RedundantContactsHaveTheMotionOfEverySolution) {
  // A of half its rank and b in its range: reactions are many, motion is one, and many vertices coincide.
  scenes::Rng rng(23);
  for (int trial = 0; trial < 60; ++trial) {
    const auto n = static_cast<std::size_t>(4 + rng.below(3));
    Environment<double> env = random_rows(rng, n);
    const std::vector<double> A = random_matrix(rng, n, n / 2, 0.0, 0.0);
    std::vector<double> source(n);
    for (double& v : source) v = rng.symmetric(1.0);
    for (std::size_t i = 0; i < n; ++i) {
      env.b[i] = 0.0;
      for (std::size_t j = 0; j < n; ++j) env.b[i] += A[i * n + j] * source[j];
    }
    env.set_dense(A, static_cast<Index>(n));
    const auto all = enumerate(env);
    const Solution<double> solution = pivot(env, 1e-9);
    if (all.empty()) {
      // Bounds that leave no vertex within the rank, or free rows alone: the judge decides.
      EXPECT_LE(judged(env, solution.lambda), 1e-9) << trial;
      continue;
    }
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << trial << ", residual " << solution.status[0].residual;
    const auto a = oracle::detail::dense_matrix(env);
    for (std::size_t i = 0; i < n; ++i) {
      long double w = env.b[i];
      for (std::size_t j = 0; j < n; ++j) w += a[i * n + j] * all.front()[j];
      EXPECT_NEAR(solution.w[i], static_cast<double>(w), 1e-8) << "trial " << trial << ", row " << i;
    }
  }
}

TEST(Lemke, TwoContactsThatPushAgainstOneAnotherEndOnARay) {
  // w_0 + w_1 = -2 whatever lambda is.
  const auto env = system({unilateral(), unilateral()}, {1, -1, -1, 1}, {-1, -1});
  const Solution<double> solution = pivot(env, 1e-9);
  EXPECT_EQ(solution.status[0].code, EnvCode::stalled);
  EXPECT_EQ(solution.status[0].flags, kFlagRay);
  EXPECT_LE(solution.status[0].iterations, 16);
  for (const double lambda : solution.lambda) EXPECT_TRUE(std::isfinite(lambda) && lambda >= 0.0);
}

TEST(Lemke, ARayIsLeftAloneByTheRestOfAnEnvironmentThatHasASolution) {
  // The same pair with b that can be met: w_0 + w_1 = 0 and the contacts are degenerate.
  const auto env = system({unilateral(), unilateral(), box()}, {1, -1, 0, -1, 1, 0, 0, 0, 2}, {-1, 1, -3});
  Environment<double> boxed = env;
  boxed.lo = {0, 0, -1};
  boxed.hi = {0, 0, 1};
  const Solution<double> solution = pivot(boxed);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_NEAR(solution.lambda[0] - solution.lambda[1], 1.0, 1e-14);
  EXPECT_NEAR(solution.lambda[2], 1.0, 1e-14);
}

TEST(Lemke, ContradictoryJointsEndFinitely) {
  // Two equalities on one motion that want different things; no pivot can help.
  const Solution<double> solution =
      pivot(system({free_row(), free_row(), unilateral()}, {1, 1, 0, 1, 1, 0, 0, 0, 1}, {-1, -2, -1}), 1e-9, 100000);
  EXPECT_NE(solution.status[0].code, EnvCode::solved);
  EXPECT_LE(solution.status[0].iterations, 16);
  EXPECT_NEAR(solution.lambda[2], 1.0, 1e-14) << "what is sound is still answered";
}

TEST(Lemke, KostrevasCyclingMatrixWithEveryRowTiedIsSolved) {
  // M. M. Kostreva, Cycling in linear complementarity problems, Math. Program. 16 (1979): a P-matrix on which pivoting
  // without a rule for ties goes in circles. With b = -1 all rows tie at the first step; lambda = 1/3 by symmetry.
  const Solution<double> solution =
      pivot(system({unilateral(), unilateral(), unilateral()}, {1, 2, 0, 0, 1, 2, 2, 0, 1}, {-1, -1, -1}));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_LE(solution.status[0].iterations, Lemke::kChunk)
      << "other choices among the tied rows come back after six pivots";
  for (const double lambda : solution.lambda) EXPECT_NEAR(lambda, 1.0 / 3.0, 1e-14);
}

TEST(Lemke, MurtysExponentialExampleIsSolvedAllTheSame) {
  // K. G. Murty, Computational complexity of complementary pivot methods, Math. Program. Study 7 (1978): ones on the
  // diagonal and twos on one side of it, b = -1. The one solution is the last contact alone: w_i = 2 - 1 above it.
  constexpr std::size_t kRows = 12;
  std::vector<double> A(kRows * kRows, 0.0);
  for (std::size_t i = 0; i < kRows; ++i)
    for (std::size_t j = i; j < kRows; ++j) A[i * kRows + j] = i == j ? 1.0 : 2.0;
  const Solution<double> solution =
      pivot(system(std::vector<Cone>(kRows, unilateral()), A, std::vector<double>(kRows, -1.0)), 1e-12, 10000);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  for (std::size_t i = 0; i < kRows; ++i) EXPECT_NEAR(solution.lambda[i], i + 1 == kRows ? 1.0 : 0.0, 1e-12) << i;
}

TEST(Lemke, ATableOnManyLegsIsDegenerateAndSolved) {
  // A mass on 40 equal legs: A all ones, rank one, every ratio tied.
  constexpr std::size_t kLegs = 40;
  const Solution<double> solution =
      pivot(system(std::vector<Cone>(kLegs, unilateral()), std::vector<double>(kLegs * kLegs, 1.0),
                   std::vector<double>(kLegs, -1.0)));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  double sum = 0.0;
  for (const double lambda : solution.lambda) sum += lambda;
  EXPECT_NEAR(sum, 1.0, 1e-13);
}

TEST(Lemke, MassesSixOrdersApartAndUnitsFarFromOneAreSolved) {
  scenes::Rng rng(31);
  for (int trial = 0; trial < 20; ++trial) {
    constexpr std::size_t kRows = 8;
    Environment<double> env = random_rows(rng, kRows);
    std::vector<double> A = random_matrix(rng, kRows, kRows, 0.0, 0.1);
    for (std::size_t i = 0; i < kRows; ++i)
      for (std::size_t j = 0; j < kRows; ++j)
        A[i * kRows + j] *= std::pow(10.0, -5.0 - 0.4 * static_cast<double>(i + j));
    env.set_dense(A, kRows);
    const Solution<double> solution = pivot(env, 1e-10);
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << trial << ", residual " << solution.status[0].residual;
    EXPECT_LE(judged(env, solution.lambda), 1e-10);
  }
}

TEST(Lemke, WithoutALoadNothingHappens) {
  const Solution<double> solution = pivot(system({unilateral(), free_row()}, {2, 1, 1, 2}, {0, 0}));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_EQ(solution.status[0].iterations, 0);
  EXPECT_EQ(solution.lambda, (std::vector<double>{0, 0}));
}

TEST(Lemke, SinglePrecisionIsAnsweredToItsRounding) {
  scenes::Rng rng(41);
  for (int trial = 0; trial < 40; ++trial) {
    constexpr std::size_t kRows = 12;
    Environment<double> env = random_rows(rng, kRows);
    env.set_dense(random_matrix(rng, kRows, kRows, 0.5, 0.1), kRows);
    const auto solution = solve_alone(convert<float>(batch_of({env})), options(SolverKind::lemke, 1e-5, 1000));
    EXPECT_EQ(solution.status[0].code, EnvCode::solved) << trial << ", residual " << solution.status[0].residual;
  }
}

}  // namespace
}  // namespace stiction::test
