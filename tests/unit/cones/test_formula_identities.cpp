#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <vector>

#include "stiction/analysis.hpp"
#include "stiction/residual.hpp"
#include "tests/support/systems/random_lcp.hpp"

// Formulas of the textbook chapter the project grew from, where their printed form is wrong. The library's results
// agree with the corrected form and disagree with the printed one. Letters are those of README.md beside this file.
// Here: (a) the step, (b) Lemke's tableau, (j) quadratic programmes, (k) islands.

namespace {

using namespace stiction;
using namespace stiction::test;

/// Start of a step and entries of its sum.
enum class Form { from_lambda_whole_sum, from_zero_without_diagonal, printed };

/// One sweep of lambda_i <- max(0, start - (b_i + sum) / A_ii).
void sweep_by_form(const Lcp& lcp, Form form, std::vector<double>& lambda) {
  for (std::size_t i = 0; i < lcp.n(); ++i) {
    double sum = lcp.b[i];
    for (std::size_t j = 0; j < lcp.n(); ++j)
      if (j != i || form == Form::from_lambda_whole_sum) sum += lcp.A[i * lcp.n() + j] * lambda[j];
    const double start = form == Form::from_zero_without_diagonal ? 0.0 : lambda[i];
    lambda[i] = std::max(0.0, start - sum / lcp.A[i * lcp.n() + i]);
  }
}

std::vector<double> after_sweeps(const Lcp& lcp, Form form, int sweeps) {
  std::vector<double> lambda(lcp.n(), 0.0);
  for (int sweep = 0; sweep < sweeps; ++sweep) sweep_by_form(lcp, form, lambda);
  return lambda;
}

double distance(const std::vector<double>& x, const std::vector<double>& y) {
  double largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) largest = std::max(largest, std::abs(x[i] - y[i]));
  return largest;
}

std::vector<double> answer(const Lcp& lcp, SolverKind solver, double tolerance, Index iterations) {
  return solve(batch_of({lcp.env()}), options(solver, tolerance, iterations)).lambda;
}

// (a) max(0, lambda_i - (b_i + sum_j A_ij lambda_j) / A_ii), or max(0, -(b_i + sum_{j != i} A_ij lambda_j) / A_ii).
// Printed: the second's sum with the first's start.
TEST(ChapterFormulas, SweepsOfPgsAreThoseOfTheTwoFormsAndNotOfTheirMixture) {
  const Lcp one{{2}, {-4}};
  for (const int sweeps : {1, 2, 4}) {
    EXPECT_EQ(answer(one, SolverKind::pgs, 0, sweeps)[0], 2);
    EXPECT_EQ(after_sweeps(one, Form::printed, sweeps)[0], 2.0 * sweeps) << "the mixture walks away";
  }
  scenes::Rng rng(1);
  int solved_as_printed = 0, other_after_two = 0;
  for (int trial = 0; trial < 200; ++trial) {
    // The matrix is so well conditioned that each sweep is the best so far, which a solve returns.
    const Lcp lcp = random_lcp(rng, 5, 5, 2.0);
    for (const int sweeps : {1, 2, 7}) {
      const std::vector<double> lambda = answer(lcp, SolverKind::pgs, 0, sweeps);
      EXPECT_LE(distance(lambda, after_sweeps(lcp, Form::from_lambda_whole_sum, sweeps)), 1e-13) << trial;
      EXPECT_LE(distance(lambda, after_sweeps(lcp, Form::from_zero_without_diagonal, sweeps)), 1e-13) << trial;
      if (sweeps == 2) other_after_two += distance(lambda, after_sweeps(lcp, Form::printed, sweeps)) > 1e-3;
    }
    EXPECT_LE(lcp.error(answer(lcp, SolverKind::pgs, 1e-12, 20000)), 1e-11) << trial;
    solved_as_printed += lcp.error(after_sweeps(lcp, Form::printed, 400)) <= 1e-3;
  }
  EXPECT_EQ(other_after_two, 200);
  EXPECT_EQ(solved_as_printed, 0);
}

// (b) w = [A e](lambda; z_0) + b, z_0 >= 0 a variable that leaves in the end. Printed: a constant, which makes b + e of
// b, and a row of zeros.
TEST(ChapterFormulas, LemkesArtificialVariableIsNotAConstant) {
  EXPECT_EQ(answer({{2}, {-4}}, SolverKind::lemke, 1e-12, 100)[0], 2);
  EXPECT_EQ(answer({{2}, {-4 + 1}}, SolverKind::lemke, 1e-12, 100)[0], 1.5) << "what the printed tableau solves";
  scenes::Rng rng(2);
  double smallest_error_as_printed = 1;
  for (int trial = 0; trial < 500; ++trial) {
    const Lcp lcp = random_lcp(rng, 12, 12, 0.1);
    EXPECT_LE(lcp.error(answer(lcp, SolverKind::lemke, 1e-12, 1000)), 1e-12) << trial;
    Lcp printed = lcp;
    for (double& entry : printed.b) entry += 1;
    const double error = lcp.error(answer(printed, SolverKind::lemke, 1e-12, 1000));
    smallest_error_as_printed = std::min(smallest_error_as_printed, error);
  }
  EXPECT_GT(smallest_error_as_printed, 1e-4) << "none of them solves what was asked";
}

// (j) LCP <=> min 1/2 lambda' A lambda + b' lambda over lambda >= 0 for A symmetric and positive semidefinite. w and
// the minimum are unique, lambda is not.
TEST(ChapterFormulas, ASymmetricSemidefiniteProblemIsAQuadraticProgramme) {
  scenes::Rng rng(3);
  for (int trial = 0; trial < 50; ++trial) {
    Lcp lcp = random_lcp(rng, 8, 3, 0.0);
    // Feasible by construction: w = v >= 0 at lambda = u >= 0.
    std::vector<double> u(8);
    for (double& entry : u) entry = rng.uniform();
    std::fill(lcp.b.begin(), lcp.b.end(), 0.0);
    const std::vector<double> Au = lcp.motion(u);
    for (std::size_t i = 0; i < 8; ++i) lcp.b[i] = (i % 2 == 0 ? rng.uniform() : 0.0) - Au[i];
    const std::vector<double> pivots = answer(lcp, SolverKind::lemke, 1e-10, 1000);
    const std::vector<double> centre = answer(lcp, SolverKind::ipm, 1e-10, 200);
    EXPECT_LE(lcp.error(pivots), 1e-9) << trial;
    EXPECT_LE(distance(lcp.motion(pivots), lcp.motion(centre)), 1e-6) << trial;
    EXPECT_NEAR(lcp.energy(pivots), lcp.energy(centre), 1e-8) << trial;
    for (int sample = 0; sample < 200; ++sample) {
      std::vector<double> other = pivots;
      for (double& entry : other) entry = std::max(0.0, entry + rng.symmetric(sample % 2 == 0 ? 1.0 : 0.01));
      EXPECT_GE(lcp.energy(other), lcp.energy(pivots) - 1e-12) << trial;
    }
  }
  // One mass on two legs: any split of its weight will do.
  const Lcp legs{{1, 1, 1, 1}, {-1, -1}};
  const auto from = [&](const std::vector<double>& start) {
    return solve(batch_of({legs.env()}), options(SolverKind::pgs, 1e-12, 100), Device::cpu(),
                 std::span<const double>(start));
  };
  EXPECT_EQ(from({1, 0}).lambda, (std::vector<double>{1, 0}));
  EXPECT_EQ(from({0, 1}).lambda, (std::vector<double>{0, 1}));
  EXPECT_EQ(from({1, 0}).w, from({0, 1}).w);
}

// (j) Friction with the sliding speed as an unknown (Stewart and Trinkle): rows normal, two tangential directions,
// speed. A unit mass slides at 1 m/s, mu = 0.5, g dt = 0.0981. The matrix is not symmetric, and its symmetric part is
// indefinite: no convex programme, and complementary pivots solve it.
TEST(ChapterFormulas, FrictionWithTheSlidingSpeedAsAnUnknownIsNoConvexProgramme) {
  constexpr double kMu = 0.5, kWeight = 0.0981;
  const Lcp lcp{{1, 0, 0, 0, 0, 1, -1, 1, 0, -1, 1, 1, kMu, -1, -1, 0}, {-kWeight, 1, -1, 0}};
  const auto batch = batch_of({lcp.env()});
  const auto solution = solve(batch, options(SolverKind::lemke, 1e-12, 8));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved);
  EXPECT_NEAR(solution.lambda[0], 0.0981, 1e-15);
  EXPECT_NEAR(solution.lambda[1] - solution.lambda[2], -0.04905, 1e-15);
  EXPECT_NEAR(solution.lambda[3], 1 - 0.04905, 1e-15) << "the speed that is left";

  EXPECT_EQ(asymmetry(batch.view())[0], 2);
  EXPECT_EQ(analyse(batch.view())[0].definiteness, Definiteness::indefinite);
  Lcp symmetric = lcp;
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j) symmetric.A[i * 4 + j] = 0.5 * (lcp.A[i * 4 + j] + lcp.A[j * 4 + i]);
  // Eigenvalues 2, 0 and those of [1 mu/2; mu/2 0], of which (1 - sqrt(1 + mu^2)) / 2 = -0.059 is the smallest in size.
  const OperatorAnalysis part = analyse(batch_of({symmetric.env()}).view())[0];
  EXPECT_EQ(part.rank, 3);
  EXPECT_NEAR(part.smallest, (std::sqrt(1 + kMu * kMu) - 1) / 2, 1e-7);
  EXPECT_EQ(part.definiteness, Definiteness::indefinite);
  EXPECT_GT(symmetric.error(solution.lambda), 0.09) << "conditions of the quadratic function are others";
}

/// Blocks of ones and a diagonal of 2, each an island.
Environment<double> islands_of(const std::vector<Index>& sizes) {
  Environment<double> env;
  Index first = 0;
  for (const Index size : sizes) {
    for (Index i = 0; i < size; ++i) {
      env.cones.push_back(unilateral());
      env.b.push_back(-1);
      for (Index j = 0; j < size; ++j) {
        env.column.push_back(first + j);
        env.A.push_back(i == j ? 2 : 1);
      }
      env.row_offsets.push_back(static_cast<Index>(env.column.size()));
    }
    first += size;
  }
  return env;
}

/// Rows of each island, as the library finds them, in its order.
std::vector<double> island_rows(const ContactBatch<double>& batch) {
  const auto view = batch.view();
  std::vector<Index> island(static_cast<std::size_t>(view.cone_count)), count(1);
  Solver(Device::cpu(), SolverOptions{}).islands(view, island.data(), count.data());
  std::vector<double> rows(static_cast<std::size_t>(count[0]), 0.0);
  for (const Index of : island) rows.at(static_cast<std::size_t>(of)) += 1;
  return rows;
}

// (k) n^3 / sum n_i^3 for a dense factorisation of each island, one after another. Printed as nearly n^2 / mean(n_i^2),
// which it is for islands of one size alone.
TEST(ChapterFormulas, TheGainOfIslandsIsCubicForFactorsAndNoneForStoredEntries) {
  const auto gains = [](const ContactBatch<double>& batch) {
    double n = 0, squares = 0, cubes = 0;
    const std::vector<double> rows = island_rows(batch);
    for (const double size : rows) {
      n += size;
      squares += size * size;
      cubes += size * size * size;
    }
    // A sweep multiplies by the stored entries, and those are the islands' own already.
    EXPECT_EQ(static_cast<double>(batch.view().nonzero_count), squares);
    return std::vector<double>{n * n * n / cubes, n * n / (squares / static_cast<double>(rows.size()))};
  };
  const auto equal = batch_of({islands_of({100, 100, 100})}), uneven = batch_of({islands_of({200, 50, 50})});
  EXPECT_EQ(island_rows(uneven), (std::vector<double>{200, 50, 50}));
  EXPECT_EQ(gains(equal), (std::vector<double>{9, 9}));
  EXPECT_NEAR(gains(uneven)[0], 3.27, 5e-3);
  EXPECT_NEAR(gains(uneven)[1], 6, 1e-12) << "the printed form, nearly twice that";

  // Apart or together, the reactions are those of each island: (A_i + 1) lambda = 1, lambda = 1 / (n_i + 1).
  for (const IslandMode mode : {IslandMode::together, IslandMode::apart}) {
    SolverOptions o = options(SolverKind::ipm, 1e-10, 100);
    o.islands = mode;
    const auto solution = solve(uneven, o);
    EXPECT_NEAR(solution.lambda[0], 1.0 / 201, 1e-9) << to_string(mode);
    EXPECT_NEAR(solution.lambda[299], 1.0 / 51, 1e-9) << to_string(mode);
  }
}

}  // namespace
