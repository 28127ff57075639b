#pragma once

#include <cstddef>
#include <vector>

#include "stiction/analysis.hpp"

/// Dense factorisations that reveal the rank and definiteness of a matrix. Matrices are row-major.
namespace stiction {

/// An upper triangle, with zeros below.
struct Triangle {
  std::vector<double> entries;  ///< (size x size)
  std::size_t size = 0;
};

/// The triangle with the singular values above `tolerance` of an n x n matrix, as many as its size. Householder QR with
/// column pivoting goes on until no remaining column is longer than the tolerance. If that leaves a trapezoid, it is
/// done once more on its transpose.
Triangle range_triangle(std::vector<double> matrix, std::size_t n, double tolerance);

/// The sign of x'Ax over all x, by Cholesky's factorisation of (A + A') / 2 with diagonal pivoting. A value up to
/// `tolerance` counts as zero. `n` is positive.
Definiteness definiteness_of(std::vector<double> matrix, std::size_t n, double tolerance);

}  // namespace stiction
