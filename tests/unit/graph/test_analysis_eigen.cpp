// Operators too large for a hand, against Eigen's dense eigenvalues.
#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_EIGEN)
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/support/oracles/dense_operator.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;
using Eigen::MatrixXd;
using Values = std::vector<double>;

/// Ascending eigenvalues of a symmetric matrix.
Values eigenvalues(const MatrixXd& A) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A, Eigen::EigenvaluesOnly);
  return {solver.eigenvalues().data(), solver.eigenvalues().data() + A.rows()};
}

/// Ascending; those of any square matrix as the upper half of the eigenvalues of (0 A; A' 0).
Values singular_values(const MatrixXd& A) {
  const Eigen::Index n = A.rows();
  MatrixXd both = MatrixXd::Zero(2 * n, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) both(i, n + j) = both(n + j, i) = A(i, j);
  const Values all = eigenvalues(both);
  return {all.begin() + n, all.end()};
}

MatrixXd symmetric_part(MatrixXd A) {
  for (Eigen::Index i = 0; i < A.rows(); ++i)
    for (Eigen::Index j = 0; j < i; ++j) A(i, j) = A(j, i) = 0.5 * (A(i, j) + A(j, i));
  return A;
}

/// Properties after however few steps: estimates from the right side, errors that are bounds, the size of the error.
void expect_bounds(const OperatorAnalysis& seen, const Values& values) {
  const std::size_t n = values.size();
  const double largest = values.back(), smallest = values[n - static_cast<std::size_t>(seen.rank)];
  const double slack = 100 * static_cast<double>(n) * 0x1p-52 * largest;  // rounding of factorisations, theirs and ours
  const auto has_one_near = [&](double value, double error) {
    return std::any_of(values.begin(), values.end(),
                       [&](double other) { return std::fabs(other - value) <= error * value + slack; });
  };
  EXPECT_LE(seen.largest, largest + slack);
  EXPECT_GE(seen.smallest, smallest - slack);
  EXPECT_TRUE(has_one_near(seen.largest, seen.largest_error));
  EXPECT_TRUE(has_one_near(seen.smallest, seen.smallest_error));
  // Kuczynski and Wozniakowski (1992): from a random vector, k steps leave a relative error of 0.871 ln n / (k - 1) on
  // average. It is that of the largest eigenvalue. Here that is one of A'A, so half of it for the singular value.
  // Twice the average.
  const auto part = [&](Index steps) { return 0.871 * std::log(static_cast<double>(n)) / std::max(steps - 1, 1); };
  if (n < 8) return;
  EXPECT_GE(seen.largest, largest * (1 - part(seen.largest_steps)) - slack);
  EXPECT_LE(seen.smallest * (1 - part(seen.smallest_steps)), smallest + slack);
}

/// Rank and definiteness where the spectrum leaves no doubt: nothing between a hundredth and a hundred times the zero
/// threshold.
void expect_decisions(const OperatorAnalysis& seen, const MatrixXd& A, const Values& values) {
  const double zero = seen.rank_tolerance;
  const auto is_doubtful = [&](double value) {
    return std::fabs(value) > 0.01 * zero && std::fabs(value) < 100 * zero;
  };
  if (std::none_of(values.begin(), values.end(), is_doubtful)) {
    EXPECT_EQ(seen.rank, std::count_if(values.begin(), values.end(), [&](double value) { return value > zero; }));
  }
  const Values part = eigenvalues(symmetric_part(A));
  if (std::any_of(part.begin(), part.end(), is_doubtful)) return;
  const Definiteness expected = part[0] < -zero  ? Definiteness::indefinite
                                : part[0] > zero ? Definiteness::positive_definite
                                                 : Definiteness::positive_semidefinite;
  EXPECT_EQ(to_string(seen.definiteness), std::string(to_string(expected)));
}

/// One environment, with few steps and with many.
void expect_like_eigen(const ContactBatchView<double>& batch, Offset env) {
  SCOPED_TRACE("environment " + std::to_string(env));
  const MatrixXd A = dense(batch, env);
  const Values values = singular_values(A);
  for (const Index steps : {20, 5000}) {
    const OperatorAnalysis seen = analyse_one(batch, env, steps);
    ASSERT_GT(seen.rank, 0);
    expect_bounds(seen, values);
    expect_decisions(seen, A, values);
  }
}

TEST(AnalysisEigen, GeneratedScenes) {
  EXPECT_GT(for_each_small_scene(expect_like_eigen), 5);
}

TEST(AnalysisEigen, Recordings) {
  std::printf("%d environments compared\n", for_each_small_recording(expect_like_eigen));
}

TEST(AnalysisEigen, RandomContactsOfFullAndOfLowRank) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Recipe recipe;
    recipe.seed = seed;
    recipe.contacts = 2 + static_cast<int>(seed) * 2;
    recipe.rank = seed % 2 == 0 ? 0.5 : 1.5;
    recipe.compliance = seed % 3 == 0 ? 0.01 : 0.0;
    ContactBatch<double> batch(Law::convex);
    batch.add(random_contacts(recipe));
    expect_like_eigen(batch.view(), 0);
    const OperatorAnalysis seen = analyse(batch.view()).at(0);
    if (recipe.rank < 1 && recipe.compliance == 0) {
      EXPECT_EQ(seen.rank, static_cast<Index>(recipe.rank * seen.rows)) << "half as many degrees of freedom as rows";
    }
  }
}

TEST(AnalysisEigen, MatricesWithoutSymmetryByTheirSingularValues) {
  scenes::Rng rng(5);
  for (const Index n : {3, 17, 60}) {
    for (const Index rank : {n, (n + 1) / 2}) {
      SCOPED_TRACE(std::to_string(n) + " rows, rank " + std::to_string(rank));
      const auto size = static_cast<std::size_t>(n), inner = static_cast<std::size_t>(rank);
      Values left(size * inner), right(inner * size), product(size * size, 0.0);
      for (double& entry : left) entry = rng.symmetric(1.0);
      for (double& entry : right) entry = rng.symmetric(1.0);
      for (std::size_t i = 0; i < size; ++i)
        for (std::size_t k = 0; k < inner; ++k)
          for (std::size_t j = 0; j < size; ++j) product[i * size + j] += left[i * inner + k] * right[k * size + j];
      const auto batch = batch_of({system(std::vector<Cone>(size, unilateral()), product, Values(size, 1.0))});
      const MatrixXd A = dense(batch.view(), 0);
      const Values values = singular_values(A);
      for (const Index steps : {20, 5000}) {
        const OperatorAnalysis seen = analyse_one(batch.view(), 0, steps);
        EXPECT_EQ(seen.rank, rank);
        EXPECT_GT(seen.asymmetry, 0.1);
        expect_bounds(seen, values);
        expect_decisions(seen, A, values);
      }
    }
  }
}

}  // namespace

#else

TEST(AnalysisEigen, GeneratedScenes) {
  GTEST_SKIP() << "Eigen is not here (libeigen3-dev): estimates are compared with hand answers only";
}

#endif
