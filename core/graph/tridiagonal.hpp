#pragma once

#include <cstddef>
#include <vector>

namespace stiction::graph {

/// A symmetric tridiagonal matrix.
struct Tridiagonal {
  std::vector<double> diagonal;
  std::vector<double> off;  ///< off[i] couples i and i + 1; entries behind the last coupling are not read
};

/// A bound on the absolute value of every eigenvalue (Gershgorin).
double reach(const Tridiagonal& T);

/// The eigenvalue that has `rank` smaller ones in [low, high], bisected by Sturm sequences until neighbouring numbers.
double eigenvalue(const Tridiagonal& T, std::size_t rank, double low, double high);

/// Householder reflections of a symmetric matrix (row-major, n x n) to tridiagonal form: the same eigenvalues.
Tridiagonal tridiagonalise(std::vector<double> matrix, std::size_t n);

}  // namespace stiction::graph
