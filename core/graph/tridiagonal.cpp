#include "core/graph/tridiagonal.hpp"

#include <cmath>
#include <limits>

namespace stiction::graph {
namespace {

/// Counts the eigenvalues of T below x (Sturm sequence).
std::size_t count_below(const Tridiagonal& T, double x) {
  std::size_t count = 0;
  double pivot = 1;
  for (std::size_t i = 0; i < T.diagonal.size(); ++i) {
    const double coupling = i == 0 ? 0 : T.off[i - 1] * T.off[i - 1] / pivot;
    pivot = T.diagonal[i] - x - coupling;
    if (pivot == 0) pivot = -std::numeric_limits<double>::min();
    if (pivot < 0) ++count;
  }
  return count;
}

}  // namespace

double reach(const Tridiagonal& T) {
  double largest = 0;
  for (std::size_t i = 0; i < T.diagonal.size(); ++i) {
    const double before = i == 0 ? 0 : std::fabs(T.off[i - 1]);
    const double after = i + 1 == T.diagonal.size() ? 0 : std::fabs(T.off[i]);
    const double radius = std::fabs(T.diagonal[i]) + before + after;
    if (radius > largest) largest = radius;
  }
  return largest;
}

double eigenvalue(const Tridiagonal& T, std::size_t rank, double low, double high) {
  while (true) {
    const double middle = 0.5 * low + 0.5 * high;
    if (!(middle > low && middle < high)) return middle;
    (count_below(T, middle) > rank ? high : low) = middle;
  }
}

Tridiagonal tridiagonalise(std::vector<double> matrix, std::size_t n) {
  Tridiagonal T;
  std::vector<double> v(n), p(n);
  for (std::size_t k = 0; k < n; ++k) {
    T.diagonal.push_back(matrix[k * n + k]);
    if (k + 1 == n) break;
    double square = 0, below = 0;
    for (std::size_t i = k + 1; i < n; ++i) {
      v[i] = matrix[i * n + k];
      square += v[i] * v[i];
      if (i > k + 1) below += v[i] * v[i];
    }
    if (below == 0) {  // tridiagonal here already
      T.off.push_back(v[k + 1]);
      continue;
    }
    const double alpha = v[k + 1] > 0 ? -std::sqrt(square) : std::sqrt(square);
    T.off.push_back(alpha);
    v[k + 1] -= alpha;
    const double half = 0.5 * (v[k + 1] * v[k + 1] + below);
    double share = 0;
    for (std::size_t i = k + 1; i < n; ++i) {
      double sum = 0;
      for (std::size_t j = k + 1; j < n; ++j) sum += matrix[i * n + j] * v[j];
      p[i] = sum / half;
      share += v[i] * p[i];
    }
    share /= 2 * half;
    for (std::size_t i = k + 1; i < n; ++i) p[i] -= share * v[i];
    for (std::size_t i = k + 1; i < n; ++i) {
      for (std::size_t j = k + 1; j < n; ++j) matrix[i * n + j] -= v[i] * p[j] + p[i] * v[j];
    }
  }
  return T;
}

}  // namespace stiction::graph
