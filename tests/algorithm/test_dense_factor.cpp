#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "core/algorithm/linear/dense/dense_factor.hpp"
#include "core/team/team.hpp"
#include "tests/support/machines/stress_team.hpp"

namespace stiction::test {
namespace {

/// G G' + shift I, row by row and column by column the same.
std::vector<double> symmetric(Index n, Index rank, double shift, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> g(static_cast<std::size_t>(n * rank)), k(static_cast<std::size_t>(n * n));
  for (double& x : g) x = normal(random);
  for (Index i = 0; i < n; ++i)
    for (Index j = 0; j < n; ++j) {
      double sum = i == j ? shift : 0.0;
      for (Index r = 0; r < rank; ++r)
        sum += g[static_cast<std::size_t>(i * rank + r)] * g[static_cast<std::size_t>(j * rank + r)];
      k[static_cast<std::size_t>(i + n * j)] = sum;
    }
  return k;
}

double worst_residual(const std::vector<double>& k, const std::vector<double>& x, const std::vector<double>& b) {
  const std::size_t n = b.size();
  double worst = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    double sum = -b[i];
    for (std::size_t j = 0; j < n; ++j) sum += k[i + n * j] * x[j];
    worst = std::max(worst, std::abs(sum));
  }
  return worst;
}

TEST(DenseFactor, SolvesWhatItFactored) {
  for (const Index n : {1, 2, 3, 17, 64}) {
    std::vector<double> k = symmetric(n, n, 0.1, 7), b(static_cast<std::size_t>(n));
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(static_cast<double>(i) + 1.0);
    std::vector<double> factor = k, x = b;
    SerialTeam team;
    EXPECT_EQ(factor_ldl(team, DenseMatrix{factor.data(), n}, 0.0), 0);
    solve_ldl(team, DenseMatrix{factor.data(), n}, x.data());
    EXPECT_LT(worst_residual(k, x, b), 1e-11) << n;
  }
}

TEST(DenseFactor, AConsistentSemidefiniteSystemIsSolvedWithoutItsNullSpace) {
  const Index n = 20, rank = 12;
  const std::vector<double> k = symmetric(n, rank, 0.0, 3);
  std::vector<double> b(n, 0.0);
  for (std::size_t i = 0; i < b.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j) b[i] += k[i + b.size() * j] * std::cos(static_cast<double>(j));
  std::vector<double> factor = k, x = b;
  SerialTeam team;
  EXPECT_EQ(factor_ldl(team, DenseMatrix{factor.data(), n}, 1e-9), n - rank);
  solve_ldl(team, DenseMatrix{factor.data(), n}, x.data());
  EXPECT_LT(worst_residual(k, x, b), 1e-9);
}

TEST(DenseFactor, TheNumberOfLanesChangesNoBit) {
  const Index n = 23;
  const std::vector<double> k = symmetric(n, n, 0.1, 11);
  const std::vector<double> b(n, 1.0);
  std::vector<double> factor = k, x = b;
  SerialTeam serial;
  factor_ldl(serial, DenseMatrix{factor.data(), n}, 0.0);
  solve_ldl(serial, DenseMatrix{factor.data(), n}, x.data());
  for (const int lanes : {2, 3, 8}) {
    std::vector<double> factor_there = k, x_there = b;
    const auto factor_and_solve = [&](auto& team) {
      factor_ldl(team, DenseMatrix{factor_there.data(), n}, 0.0);
      solve_ldl(team, DenseMatrix{factor_there.data(), n}, x_there.data());
    };
    if (lanes == 3) {  // each takes a row at once
      run_stressed<1>(lanes, factor_and_solve);
    } else {
      run_stressed<4>(lanes, factor_and_solve);
    }
    EXPECT_EQ(factor_there, factor) << lanes;
    EXPECT_EQ(x_there, x) << lanes;
  }
}

}  // namespace
}  // namespace stiction::test
