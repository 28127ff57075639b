#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "scenes/rng.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Linear complementarity problems 0 <= lambda _|_ w = A lambda + b >= 0 as dense arrays, and as environments.
namespace stiction::test {

struct Lcp {
  std::vector<double> A;  ///< row-major             (n x n)
  std::vector<double> b;  ///< right-hand side       (n)

  [[nodiscard]] std::size_t n() const { return b.size(); }
  [[nodiscard]] Environment<double> env() const { return system(std::vector<Cone>(n(), unilateral()), A, b); }

  /// A lambda + b, row by row.
  [[nodiscard]] std::vector<double> motion(const std::vector<double>& lambda) const {
    std::vector<double> w = b;
    for (std::size_t i = 0; i < n(); ++i)
      for (std::size_t j = 0; j < n(); ++j) w[i] += A[i * n() + j] * lambda[j];
    return w;
  }
  /// max |min(lambda, w)|, which is zero at solutions and nowhere else.
  [[nodiscard]] double error(const std::vector<double>& lambda) const {
    const std::vector<double> w = motion(lambda);
    double largest = 0;
    for (std::size_t i = 0; i < n(); ++i) {
      const double smaller = std::min(lambda[i], w[i]);
      const double size = smaller < 0 ? -smaller : smaller;
      if (!(size <= largest)) largest = size;
    }
    return largest;
  }
  /// 1/2 lambda' A lambda + b' lambda.
  [[nodiscard]] double energy(const std::vector<double>& lambda) const {
    const std::vector<double> w = motion(lambda);
    double sum = 0;
    for (std::size_t i = 0; i < n(); ++i) sum += 0.5 * lambda[i] * (w[i] + b[i]);
    return sum;
  }
};

/// A = G G' + shift, G of n x rank numbers in (-1, 1); b in (-1, 1), its first entry negative.
inline Lcp random_lcp(scenes::Rng& rng, std::size_t n, std::size_t rank, double shift) {
  Lcp lcp{std::vector<double>(n * n, 0.0), std::vector<double>(n)};
  std::vector<double> G(n * rank);
  for (double& entry : G) entry = rng.symmetric(1.0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      for (std::size_t k = 0; k < rank; ++k) lcp.A[i * n + j] += G[i * rank + k] * G[j * rank + k];
      if (i == j) lcp.A[i * n + j] += shift;
    }
  for (double& entry : lcp.b) entry = rng.symmetric(1.0);
  if (lcp.b[0] > 0) lcp.b[0] = -lcp.b[0];
  return lcp;
}

}  // namespace stiction::test
