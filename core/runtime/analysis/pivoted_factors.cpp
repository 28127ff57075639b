#include "core/runtime/analysis/pivoted_factors.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/extents.hpp"

namespace stiction {
namespace {

/// The first `rank` rows of the triangle of a rows x columns matrix, its columns in the order of the pivots.
struct Trapezoid {
  std::vector<double> entries;  ///< (rank x columns)
  std::size_t rank = 0, columns = 0;
};

/// Working storage of one factorisation by Householder reflections. Inner loops run along rows, where numbers lie side
/// by side. Norms of columns are computed anew at each step, so that none is a difference of large ones.
class PivotedReflections {
 public:
  PivotedReflections(std::vector<double> matrix, std::size_t rows, std::size_t columns)
      : a_(std::move(matrix)), rows_(rows), columns_(columns), row_(columns), v_(rows) {}

  Trapezoid factorise(double tolerance) {
    const std::size_t most = smaller_of(rows_, columns_);
    std::size_t rank = 0;
    while (rank < most && bring_longest(rank) > tolerance) reflect(rank++);
    a_.resize(rank * columns_);
    return {std::move(a_), rank, columns_};
  }

 private:
  double& at(std::size_t i, std::size_t j) { return a_[i * columns_ + j]; }

  /// Exchanges column k with the longest from it on, rows above k left out; its length.
  double bring_longest(std::size_t k) {
    std::fill(row_.begin(), row_.end(), 0.0);
    for (std::size_t i = k; i < rows_; ++i)
      for (std::size_t j = k; j < columns_; ++j) row_[j] += at(i, j) * at(i, j);
    const auto longest = std::max_element(row_.begin() + static_cast<std::ptrdiff_t>(k), row_.end());
    const auto column = static_cast<std::size_t>(longest - row_.begin());
    for (std::size_t i = 0; i < rows_ && column != k; ++i) std::swap(at(i, k), at(i, column));
    return std::sqrt(*longest);
  }

  /// Makes column k zero below the diagonal.
  void reflect(std::size_t k) {
    double square = 0;
    for (std::size_t i = k; i < rows_; ++i) {
      v_[i] = at(i, k);
      square += v_[i] * v_[i];
      at(i, k) = 0;
    }
    const double diagonal = v_[k] > 0 ? -std::sqrt(square) : std::sqrt(square);
    const double half = square - v_[k] * diagonal;  // half the square of the future v
    v_[k] -= diagonal;
    at(k, k) = diagonal;
    std::fill(row_.begin(), row_.end(), 0.0);
    for (std::size_t i = k; i < rows_; ++i)
      for (std::size_t j = k + 1; j < columns_; ++j) row_[j] += v_[i] * at(i, j);
    for (std::size_t i = k; i < rows_; ++i) {
      const double share = v_[i] / half;
      for (std::size_t j = k + 1; j < columns_; ++j) at(i, j) -= share * row_[j];
    }
  }

  std::vector<double> a_;
  std::size_t rows_, columns_;
  std::vector<double> row_, v_;
};

}  // namespace

Triangle range_triangle(std::vector<double> matrix, std::size_t n, double tolerance) {
  Trapezoid wide = PivotedReflections(std::move(matrix), n, n).factorise(tolerance);
  if (wide.rank == n) return {std::move(wide.entries), n};
  std::vector<double> tall(wide.entries.size());
  for (std::size_t i = 0; i < wide.rank; ++i)
    for (std::size_t j = 0; j < n; ++j) tall[j * wide.rank + i] = wide.entries[i * n + j];
  Trapezoid square = PivotedReflections(std::move(tall), n, wide.rank).factorise(0.0);
  return {std::move(square.entries), square.rank};
}

Definiteness definiteness_of(std::vector<double> matrix, std::size_t n, double tolerance) {
  const auto at = [&](std::size_t i, std::size_t j) -> double& { return matrix[i * n + j]; };
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) at(i, j) = at(j, i) = 0.5 * (at(i, j) + at(j, i));
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t i = k; i < n; ++i) {
      if (at(i, i) < -tolerance) return Definiteness::indefinite;
      if (at(i, i) > at(pivot, pivot)) pivot = i;
    }
    if (at(pivot, pivot) <= tolerance) {
      // Nothing on the diagonal to speak of: beside it there may be nothing either.
      for (std::size_t i = k; i < n; ++i)
        for (std::size_t j = k; j < n; ++j)
          if (std::fabs(at(i, j)) > tolerance) return Definiteness::indefinite;
      return Definiteness::positive_semidefinite;
    }
    if (pivot != k) {
      std::swap_ranges(&at(k, 0), &at(k, 0) + n, &at(pivot, 0));
      for (std::size_t i = k; i < n; ++i) std::swap(at(i, k), at(i, pivot));
    }
    for (std::size_t i = k + 1; i < n; ++i) {
      const double share = at(i, k) / at(k, k);
      if (share == 0) continue;
      for (std::size_t j = k + 1; j < n; ++j) at(i, j) -= share * at(k, j);
    }
  }
  return Definiteness::positive_definite;
}

}  // namespace stiction
