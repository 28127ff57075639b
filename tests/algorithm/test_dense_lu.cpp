#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "core/algorithm/linear/dense/dense_lu.hpp"
#include "core/team/team.hpp"
#include "tests/support/machines/stress_team.hpp"

namespace stiction::test {
namespace {

/// Column by column, numbers of both signs and no structure.
std::vector<double> general(Index n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<double> k(static_cast<std::size_t>(n * n));
  for (double& x : k) x = normal(random);
  return k;
}

std::vector<double> image(const std::vector<double>& k, const std::vector<double>& x) {
  const std::size_t n = x.size();
  std::vector<double> b(n, 0.0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) b[i] += k[i + n * j] * x[j];
  return b;
}

struct Factored {
  std::vector<double> factor, pivots, x;
  Index replaced;
};
template <class B>
void factor_and_solve(B& team, Factored& f) {
  const DenseMatrix K{f.factor.data(), static_cast<Index>(f.x.size())};
  const Index replaced = factor_lu(team, K, f.pivots.data());
  solve_lu(team, K, f.pivots.data(), f.x.data());
  single(team, [&] { f.replaced = replaced; });
}
Factored solved(const std::vector<double>& k, const std::vector<double>& b) {
  Factored f{k, std::vector<double>(b.size()), b, -1};
  SerialTeam team;
  factor_and_solve(team, f);
  return f;
}

TEST(DenseLu, SolvesWhatItFactored) {
  for (const Index n : {1, 2, 3, 17, 64}) {
    const std::vector<double> k = general(n, 5);
    std::vector<double> b(static_cast<std::size_t>(n));
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(static_cast<double>(i) + 1.0);
    const Factored f = solved(k, b);
    EXPECT_EQ(f.replaced, 0) << n;
    const std::vector<double> again = image(k, f.x);
    for (std::size_t i = 0; i < b.size(); ++i) EXPECT_NEAR(again[i], b[i], 1e-10) << n << ", row " << i;
  }
}

TEST(DenseLu, AZeroInAPivotsPlaceIsNoObstacle) {
  // 2 x_1 = 4, 3 x_0 + x_1 = 5.
  const Factored f = solved({0, 3, 2, 1}, {4, 5});
  EXPECT_EQ(f.replaced, 0);
  EXPECT_DOUBLE_EQ(f.x[0], 1.0);
  EXPECT_DOUBLE_EQ(f.x[1], 2.0);
  EXPECT_EQ(f.pivots, (std::vector<double>{1, 1}));
}

TEST(DenseLu, AmongEqualMagnitudesTheFirstRowIsThePivot) {
  const Factored f = solved({1, -2, 2, 0, 1, 1, 1, 1, 5}, {1, 1, 1});
  EXPECT_EQ(f.pivots[0], 1.0);
}

TEST(DenseLu, ADirectionThatTheMatrixDoesNotSeeGetsNoPartOfTheSolution) {
  const Factored f = solved({1, 0, 0, 0, 0, 0, 0, 0, 4}, {3, 7, 8});
  EXPECT_EQ(f.replaced, 1);
  EXPECT_EQ(f.x[0], 3.0);
  EXPECT_LT(std::abs(f.x[1]), 1e-100);
  EXPECT_EQ(f.x[2], 2.0);
}

TEST(DenseLu, TheNumberOfLanesChangesNoBit) {
  const std::vector<double> k = general(23, 9);
  const std::vector<double> b(23, 1.0);
  const Factored serial = solved(k, b);
  for (const Index lanes : {2, 3, 8, 33}) {
    Factored there{k, std::vector<double>(b.size()), b, -1};
    run_stressed<4>(lanes, [&](auto& team) { factor_and_solve(team, there); });
    EXPECT_EQ(there.factor, serial.factor) << lanes;
    EXPECT_EQ(there.pivots, serial.pivots) << lanes;
    EXPECT_EQ(there.x, serial.x) << lanes;
  }
}

}  // namespace
}  // namespace stiction::test
