#pragma once

#include "core/algorithm/problem/cone_shape.hpp"
#include "core/team/phases.hpp"

/// The blocks that a matrix over an environment's rows has on its cones, factored. They precondition conjugate
/// gradients in methods that have no room for the matrix.
namespace stiction::inline STICTION_ISA {

/// The rows of one cone.
template <int M>
STICTION_HD void load(const double* from, Index row, double (&to)[M]) {
  for (int k = 0; k < M; ++k) to[k] = from[row + k];
}
template <int M>
STICTION_HD void store(const double (&from)[M], double* to, Index row) {
  for (int k = 0; k < M; ++k) to[row + k] = from[k];
}

/// Doubles of the cones' blocks for every row.
inline constexpr Index kConeBlockWorkspace = kMaxConeRows;

/// Returns the block of the cone at `row`.
STICTION_HD double* cone_block(double* blocks, Index row) {
  return blocks + static_cast<Offset>(row) * kConeBlockWorkspace;
}

/// The cone's block of A + diag R, symmetrised.
template <int M, class System>
STICTION_HD void read_cone_block(const System& s, Index row, double (&K)[M][M]) {
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < M; ++j)
      K[i][j] = 0.5 * (static_cast<double>(s.block_entry(row, i, j)) + static_cast<double>(s.block_entry(row, j, i)));
}

/// L of K = L L', row by row. A pivot that rounding has made zero or less is replaced: its direction is then left
/// alone.
template <int M>
STICTION_HD void factor_cone_block(const double (&K)[M][M], double* L) {
  constexpr double kOutOfReach = 0x1p+500;
  for (int j = 0; j < M; ++j) {
    double pivot = K[j][j];
    for (int k = 0; k < j; ++k) pivot = fma_(0.0 - L[j * M + k], L[j * M + k], pivot);
    const double root = pivot > 0.0 ? sqrt_(pivot) : kOutOfReach;
    L[j * M + j] = root;
    for (int i = j + 1; i < M; ++i) {
      double entry = K[i][j];
      for (int k = 0; k < j; ++k) entry = fma_(0.0 - L[i * M + k], L[j * M + k], entry);
      L[i * M + j] = div_(entry, root);
    }
  }
}

/// The inverse of the blocks whose factors are there, as a preconditioner.
template <class System>
struct ConeBlocks {
  const System* s;
  double* factors;  ///< (kConeBlockWorkspace n)

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      const double* const L = cone_block(factors, row);
      double v[kRows];
      load(r, row, v);
      for (int i = 0; i < kRows; ++i) {
        for (int k = 0; k < i; ++k) v[i] = fma_(0.0 - L[i * kRows + k], v[k], v[i]);
        v[i] = div_(v[i], L[i * kRows + i]);
      }
      for (int i = kRows - 1; i >= 0; --i) {
        for (int k = i + 1; k < kRows; ++k) v[i] = fma_(0.0 - L[k * kRows + i], v[k], v[i]);
        v[i] = div_(v[i], L[i * kRows + i]);
      }
      store(v, z, row);
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
