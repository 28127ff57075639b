#pragma once

#include "stiction/types.hpp"

namespace stiction {

/// Largest environment for which a method may keep a matrix of its own, by default.
inline constexpr Index kDirectRows = 1024;
/// The caller's largest value: a matrix of 8 GiB.
inline constexpr Index kMostDirectRows = 32768;

/// Memory of a method beside the system. Vectors and matrices of double are for methods that factorise: whatever the
/// solve's precision, an elimination of hundreds of rows is done in double. Such a method takes environments one at a
/// time, never in packs or bundles. If an environment is too large for matrices, a method that can do without has
/// further vectors instead.
struct Workspace {
  Index vectors = 0;                ///< of n numbers of Real
  Index f64_vectors = 0;            ///< of n doubles
  Index dense_matrices = 0;         ///< of n x n doubles, for environments of at most direct_rows rows
  Index matrix_free_vectors = 0;    ///< of n doubles, for larger ones; 0: the method has no other way
  Index direct_rows = kDirectRows;  ///< no less than dense systems have rows
  Index real_matrices = 0;          ///< of n x n numbers of Real beside a dense system: for lanes of packs, too

  /// Returns true if an environment of n rows gets the matrices.
  [[nodiscard]] STICTION_HD constexpr bool has_matrices(Offset n) const { return n <= direct_rows; }
  /// Doubles for an environment of n rows. Not monotone: one without matrices may need less than a smaller one.
  [[nodiscard]] STICTION_HD constexpr Offset doubles(Offset n) const {
    return f64_vectors * n + (has_matrices(n) ? dense_matrices * n * n : matrix_free_vectors * n);
  }
  /// These doubles in numbers of Real.
  template <class Real>
  [[nodiscard]] STICTION_HD constexpr Offset double_elements(Offset n) const {
    return doubles(n) * static_cast<Offset>((sizeof(double) + sizeof(Real) - 1) / sizeof(Real));
  }
  /// Numbers of Real for the squares of a dense system of n rows.
  [[nodiscard]] STICTION_HD constexpr Offset square_elements(Offset n) const { return real_matrices * n * n; }
  /// The workspace without the parts that no loading touches.
  [[nodiscard]] STICTION_HD constexpr Workspace to_load() const {
    Workspace workspace = *this;
    workspace.real_matrices = 0;
    return workspace;
  }
  /// The workspace for lanes each of which has an environment: no doubles.
  [[nodiscard]] STICTION_HD constexpr Workspace in_bundles() const {
    Workspace workspace;
    workspace.vectors = vectors;
    workspace.real_matrices = real_matrices;
    return workspace;
  }
  /// The workspace with matrices for environments of up to `rows` rows.
  [[nodiscard]] STICTION_HD constexpr Workspace up_to(Index rows) const {
    Workspace workspace = *this;
    workspace.direct_rows = rows;
    return workspace;
  }
  /// Returns true if the method factorises.
  [[nodiscard]] STICTION_HD constexpr bool is_direct() const { return f64_vectors > 0 || dense_matrices > 0; }
};

}  // namespace stiction
