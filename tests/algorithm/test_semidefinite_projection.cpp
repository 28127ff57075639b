// Projections onto semidefinite matrices: by hand, beside Eigen's eigenvalues in long double, and the properties of
// every projection onto a cone.
#include "core/algorithm/sweep/semidefinite_projection.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "scenes/rng.hpp"

#if defined(STICTION_TEST_HAS_EIGEN)
#include <Eigen/Eigenvalues>
#endif

namespace {

using namespace stiction;

template <class Real, std::size_t M>
using Rows = std::array<Real, M>;

template <class Real, std::size_t M>
Rows<Real, M> projected(const Rows<Real, M>& rows) {
  Real z[M];
  std::copy(rows.begin(), rows.end(), z);
  project_semidefinite(z);
  Rows<Real, M> result;
  std::copy(z, z + M, result.begin());
  return result;
}

template <class Real, std::size_t M>
Real largest_of(const Rows<Real, M>& rows) {
  Real largest = 0;
  for (const Real value : rows) largest = std::max(largest, std::abs(value));
  return largest;
}

/// Returns true if row k is on the diagonal.
bool is_diagonal(std::size_t k) {
  return k == 0 || k == 2 || k == 5;
}

/// A matrix of one of six kinds. It is any, or of rank one, or the unit with little beside it. Or it is graded over ten
/// powers of ten, has a repeated eigenvalue, or one of the sizes that Real has.
template <class Real, std::size_t M>
Rows<Real, M> some_matrix(scenes::Rng& rng, int kind) {
  constexpr int n = M == 3 ? 2 : 3;
  Rows<Real, M> rows{};
  double v[n];
  double square = 0;
  for (double& entry : v) {
    entry = rng.symmetric(1.0);
    square += entry * entry;
  }
  std::size_t k = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i <= j; ++i, ++k) {
      const double root = i == j ? 1.0 : std::sqrt(2.0);
      const double any = rng.symmetric(1.0);
      const double power = rng.uniform(-10, 0);
      switch (kind % 6) {
        case 0:
          rows[k] = static_cast<Real>(any);
          break;
        case 1:
          rows[k] = static_cast<Real>(root * v[i] * v[j] * (kind % 12 < 6 ? 1 : -1));
          break;
        case 2:
          rows[k] = static_cast<Real>(i == j ? (kind % 12 < 6 ? 1 : -1) : 1e-7 * any * (kind % 4 == 0));
          break;
        case 3:
          rows[k] = static_cast<Real>(any * std::pow(10.0, power));
          break;
        case 4:
          rows[k] = static_cast<Real>(root * ((i == j ? 1.0 : 0.0) - 2 * v[i] * v[j] / square));
          break;
        default:
          rows[k] = static_cast<Real>(any * std::pow(10.0, (kind % 61 - 30) * (sizeof(Real) == 4 ? 1.0 : 10.0)));
      }
    }
  return rows;
}

/// The accuracy of a projection relative to its matrix's largest row, in roundings. Measured over 2e5 of the kinds
/// above: at most 2.7 for order 2, 13 for order 3, whose rotations round six times over.
template <std::size_t M>
constexpr double kRoundings = M == 3 ? 6 : 32;

template <class Real, std::size_t M>
void expect_a_projection() {
  constexpr double kEpsilon = static_cast<double>(std::numeric_limits<Real>::epsilon());
  scenes::Rng rng(7);
  Rows<Real, M> before{};
  for (int k = 0; k < 20000 && !testing::Test::HasFailure(); ++k) {
    const Rows<Real, M> z = some_matrix<Real, M>(rng, k);
    SCOPED_TRACE("matrix " + std::to_string(k));
    const double size = static_cast<double>(largest_of(z));
    if (size == 0) continue;
    const double near = kRoundings<M> * kEpsilon * size;
    Rows<Real, M> negative = z;
    for (Real& row : negative) row = -row;
    const Rows<Real, M> positive_part = projected(z), negative_part = projected(negative);
    const Rows<Real, M> again = projected(positive_part);
    double product = 0, moved = 0, apart = 0;
    for (std::size_t i = 0; i < M; ++i) {
      EXPECT_NEAR(static_cast<double>(again[i]), static_cast<double>(positive_part[i]), near)
          << "idempotent, row " << i;
      EXPECT_NEAR(static_cast<double>(positive_part[i]) - static_cast<double>(negative_part[i]),
                  static_cast<double>(z[i]), near)
          << "Moreau, row " << i;
      product += (static_cast<double>(positive_part[i]) / size) * (static_cast<double>(negative_part[i]) / size);
    }
    EXPECT_LE(std::abs(product), 2 * kRoundings<M> * kEpsilon) << "the two parts are orthogonal";
    // No two matrices come apart. Matrices of one kind have like sizes but for the last, whose sizes are of their own.
    const Rows<Real, M> other = projected(before);
    const double both = std::max(size, static_cast<double>(largest_of(before)));
    for (std::size_t i = 0; i < M; ++i) {
      moved += std::pow((static_cast<double>(positive_part[i]) - static_cast<double>(other[i])) / both, 2);
      apart += std::pow((static_cast<double>(z[i]) - static_cast<double>(before[i])) / both, 2);
    }
    EXPECT_LE(std::sqrt(moved), std::sqrt(apart) + 4 * kRoundings<M> * kEpsilon) << "nonexpansive";
    before = z;
  }
}

TEST(SemidefiniteProjection, DoesWhatProjectionsOntoConesDo) {
  expect_a_projection<float, 3>();
  expect_a_projection<double, 3>();
  expect_a_projection<float, 6>();
  expect_a_projection<double, 6>();
}

TEST(SemidefiniteProjection, OrderTwoByHand) {
  const double root = std::sqrt(2.0);
  using Matrix = Rows<double, 3>;
  EXPECT_EQ(projected(Matrix{2, root, 3}), (Matrix{2, root, 3})) << "inside";
  EXPECT_EQ(projected(Matrix{-2, root, -3}), (Matrix{0, 0, 0})) << "inside the polar cone";
  EXPECT_EQ(projected(Matrix{3, 0, -4}), (Matrix{3, 0, 0}));
  EXPECT_EQ(projected(Matrix{-4, 0, 3}), (Matrix{0, 0, 3}));
  EXPECT_EQ(projected(Matrix{0, 0, 0}), (Matrix{0, 0, 0}));
  // Eigenvalues 1 and -1 with vectors (1, 1) and (1, -1) over sqrt(2).
  const Matrix found = projected(Matrix{0, root, 0});
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(found[k], k == 1 ? 0.5 * root : 0.5, 4e-16) << k;
}

// Here mean + radius would be all rounding.
TEST(SemidefiniteProjection, TheSmallEigenvalueOfOrderTwoKeepsItsDigits) {
  const double t = 1e-9;
  const Rows<double, 3> found = projected(Rows<double, 3>{-1, std::sqrt(2.0) * t, 0});
  // Eigenvalues of [-1 t; t 0]: t^2 (1 - t^2 + ...) with vector (t, 1).
  EXPECT_NEAR(found[2] / (t * t), 1.0, 1e-14);
  EXPECT_NEAR(found[1] / (std::sqrt(2.0) * t * t * t), 1.0, 1e-14);
  EXPECT_NEAR(found[0] / (t * t * t * t), 1.0, 1e-14);
}

// a_11 a_22 = 2 (1 - 2^-60) rounds to a_12^2 = 2, and the matrix would count as negative. Its null vector is nearly
// (1, sqrt(2)), its other eigenvalue -3.
TEST(SemidefiniteProjection, ADeterminantThatRoundingHidesCounts) {
  const double e = 0x1p-30;
  const Rows<double, 3> found = projected(Rows<double, 3>{-2 * (1 + e), 2, e - 1});
  EXPECT_NEAR(found[0] * 0x1p59, 1.0 / 9, 1e-8);
  EXPECT_NEAR(found[2] * 0x1p59, 2.0 / 9, 1e-8);
}

TEST(SemidefiniteProjection, OrderThreeByHand) {
  using Matrix = Rows<double, 6>;
  EXPECT_EQ(projected(Matrix{1, 0, 2, 0, 0, 3}), (Matrix{1, 0, 2, 0, 0, 3})) << "inside: its bits stay";
  EXPECT_EQ(projected(Matrix{-1, 0, -2, 0, 0, -3}), (Matrix{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(projected(Matrix{1, 0, -2, 0, 0, 3}), (Matrix{1, 0, 0, 0, 0, 3}));
  // Rows are the upper triangle column by column: a_13 and a_23 are rows 3 and 4. [0 1; 1 0] in each pair by itself.
  const double root = std::sqrt(2.0);
  const std::array<std::array<std::size_t, 3>, 3> pairs{{{0, 1, 2}, {0, 3, 5}, {2, 4, 5}}};
  for (const auto& [left, off, right] : pairs) {
    Matrix matrix{};
    matrix[off] = root;
    const Matrix found = projected(matrix);
    for (std::size_t k = 0; k < 6; ++k) {
      const double expected = k == left || k == right ? 0.5 : k == off ? 0.5 * root : 0.0;
      EXPECT_NEAR(found[k], expected, 4e-16) << "pair " << off << ", row " << k;
    }
  }
}

#if defined(STICTION_TEST_HAS_EIGEN)

template <int N>
using Wide = Eigen::Matrix<long double, N, N>;

/// The nearest matrix by Eigen's eigenvalues of the matrix over its largest row.
template <class Real, std::size_t M>
Rows<long double, M> oracle(const Rows<Real, M>& rows, long double size) {
  constexpr int N = M == 3 ? 2 : 3;
  const long double root = std::sqrt(2.0L);
  Wide<N> S;
  std::size_t k = 0;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i <= j; ++i, ++k) S(i, j) = S(j, i) = rows[k] / size / (i == j ? 1.0L : root);
  const Eigen::SelfAdjointEigenSolver<Wide<N>> eigen(S);
  Wide<N> P = Wide<N>::Zero();
  for (int l = 0; l < N; ++l)
    if (eigen.eigenvalues()[l] > 0)
      P += eigen.eigenvalues()[l] * eigen.eigenvectors().col(l) * eigen.eigenvectors().col(l).transpose();
  Rows<long double, M> result;
  k = 0;
  for (int j = 0; j < N; ++j)
    for (int i = 0; i <= j; ++i, ++k) result[k] = P(i, j) * (i == j ? 1.0L : root);
  return result;
}

template <class Real, std::size_t M>
void expect_oracle() {
  scenes::Rng rng(11);
  for (int k = 0; k < 6000 && !testing::Test::HasFailure(); ++k) {
    const Rows<Real, M> z = some_matrix<Real, M>(rng, k);
    const long double size = largest_of(z);
    if (size == 0) continue;
    const Rows<Real, M> found = projected(z);
    const Rows<long double, M> expected = oracle(z, size);
    for (std::size_t i = 0; i < M; ++i)
      EXPECT_NEAR(static_cast<double>(found[i] / size), static_cast<double>(expected[i]),
                  kRoundings<M> * static_cast<double>(std::numeric_limits<Real>::epsilon()))
          << "matrix " << k << ", row " << i;
  }
}

TEST(SemidefiniteProjection, IsWhatEigenFindsInLongDouble) {
  expect_oracle<float, 3>();
  expect_oracle<double, 3>();
  expect_oracle<float, 6>();
  expect_oracle<double, 6>();
}

#endif

// Squares of the small entries vanish in float. A rotation by their quotient would throw 7e-7 into the second diagonal.
TEST(SemidefiniteProjection, EntriesWhoseSquaresVanishAreNoTrap) {
  const Rows<float, 6> z{3.46054605e-07F,  1.85680127e-17F,  4.98145488e-28F,
                         -0.000184743549F, -7.00930691e-15F, 0.0493132845F};
  const Rows<float, 6> found = projected(z);
  for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(found[k], z[k], 32 * 1.2e-7 * 0.05) << k;
}

template <class Real>
void expect_ends_of_the_range() {
  using Limits = std::numeric_limits<Real>;
  const Real huge = Limits::max() / 2 * Real(1.5), tiny = Limits::denorm_min() * 8;
  const Rows<Real, 3> large = projected(Rows<Real, 3>{huge, 0, -huge});
  EXPECT_EQ(large, (Rows<Real, 3>{huge, 0, 0}));
  const Rows<Real, 6> longer = projected(Rows<Real, 6>{-huge, 0, huge, 0, 0, huge});
  EXPECT_EQ(longer, (Rows<Real, 6>{0, 0, huge, 0, 0, huge}));
  const Rows<Real, 6> small = projected(Rows<Real, 6>{tiny, 0, -tiny, 0, 0, tiny});
  EXPECT_EQ(small, (Rows<Real, 6>{tiny, 0, 0, 0, 0, tiny}));
  for (const Real broken : {Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()})
    for (std::size_t k = 0; k < 6; ++k) {
      Rows<Real, 6> z{1, 0, 1, 0, 0, 1};
      z[k] = broken;
      for (const Real row : projected(z)) EXPECT_FALSE(std::isfinite(row)) << "row " << k;
      if (k > 2) continue;
      Rows<Real, 3> two{1, 0, 1};
      two[k] = broken;
      for (const Real row : projected(two)) EXPECT_FALSE(std::isfinite(row)) << "row " << k;
    }
}

TEST(SemidefiniteProjection, NumbersAtTheEndsOfTheRangeAreProjectedAndThoseBeyondShow) {
  expect_ends_of_the_range<float>();
  expect_ends_of_the_range<double>();
}

TEST(SemidefiniteProjection, AMatrixInsideKeepsItsBits) {
  scenes::Rng rng(5);
  for (int k = 0; k < 2000; ++k) {
    Rows<double, 6> z{};
    for (std::size_t i = 0; i < 6; ++i) z[i] = is_diagonal(i) ? rng.uniform(3, 4) : rng.symmetric(1.0);
    EXPECT_EQ(projected(z), z);
  }
}

}  // namespace
