#pragma once

/// \file
/// Structure of a batch: environments, cones, and where the entries of A are (docs/reference/data_layout.md).

#include <cstdint>

#include "stiction/types.hpp"

namespace stiction {

/// Memory in which the arrays of a view live.
enum class MemorySpace : std::uint8_t {
  host = 0,  ///< memory of the process
  cuda = 1,  ///< memory of a CUDA device, or of the emulated one
};

/// Rows and cones of environments, whatever the form of A. Rows and cones of all environments follow one
/// another.
struct BatchLayout {
  Offset env_count = 0;                      ///< environments
  Offset cone_count = 0;                     ///< cones of all environments
  Offset row_count = 0;                      ///< rows of all environments
  const Offset* env_row_offsets = nullptr;   ///< first row of each environment        (env_count + 1)
  const Offset* env_cone_offsets = nullptr;  ///< first cone of each environment       (env_count + 1)
  const Index* env_row_counts = nullptr;     ///< rows in use; null: up to the next one's first   (env_count)
  const Index* env_cone_counts = nullptr;    ///< cones in use; null: up to the next one's first  (env_count)
  const std::uint32_t* env_flags = nullptr;  ///< EnvFlag bits found when the batch was made. They enter the status; all
                                             ///< but kFlagContactsDropped forbid a solve; null: none  (env_count)
  const double* env_tolerance = nullptr;     ///< relative residual that will do for each, instead of the option; below
                                             ///< zero or NaN: the option; null: for all [-]    (env_count)
  const Index* env_max_iterations = nullptr;  ///< iterations for each, instead of the option; below zero: the option;
                                              ///< null: for all                                (env_count)
  const ConeKind* cone_kind = nullptr;        ///< kind                                  (cone_count)
  const Offset* cone_row_offsets = nullptr;   ///< first row of each cone                (cone_count + 1)
  const Index* cone_group = nullptr;          ///< manifold: neighbouring cones of one environment with equal
                                              ///< non-negative id are coloured as one vertex; null: none  (cone_count)
  Law law = Law::convex;                      ///< of the friction cones
  MemorySpace space = MemorySpace::host;      ///< where all arrays are

  /// Rows of an environment.
  [[nodiscard]] STICTION_HD Index env_rows(Offset env) const {
    return env_row_counts != nullptr ? env_row_counts[env]
                                     : static_cast<Index>(env_row_offsets[env + 1] - env_row_offsets[env]);
  }
  /// Cones of an environment.
  [[nodiscard]] STICTION_HD Index env_cones(Offset env) const {
    return env_cone_counts != nullptr ? env_cone_counts[env]
                                      : static_cast<Index>(env_cone_offsets[env + 1] - env_cone_offsets[env]);
  }
};

/// Offsets of the entries of A, or of its factor.
struct MatrixPattern {
  Offset nonzero_count = 0;                ///< stored entries of all A
  const Offset* row_offsets = nullptr;     ///< CSR rows of A                        (row_count + 1)
  const Index* row_counts = nullptr;       ///< entries in use of each row; null: up to the next row's (row_count)
  const Index* column = nullptr;           ///< CSR columns, within the environment  (nonzero_count)
  const Offset* column_offsets = nullptr;  ///< first column of each row, where rows share columns; null:
                                           ///< row_offsets                           (row_count)
  Offset column_count = 0;                 ///< length of column where column_offsets is given
  const Offset* factor_offsets = nullptr;  ///< first entry of Y of each environment; one that has any stores no A,
                                           ///< which is Y Y' then (docs/howto/jacobian.md); null: none  (env_count + 1)
  Offset factor_count = 0;                 ///< length of factor

  /// Stored entries of a row of the batch.
  [[nodiscard]] STICTION_HD Index row_entries(Offset row) const {
    return row_counts != nullptr ? row_counts[row] : static_cast<Index>(row_offsets[row + 1] - row_offsets[row]);
  }
  /// Their columns.
  [[nodiscard]] STICTION_HD const Index* row_columns(Offset row) const {
    return column + (column_offsets != nullptr ? column_offsets : row_offsets)[row];
  }
  /// Returns the number of entries of `column`.
  [[nodiscard]] STICTION_HD Offset columns_stored() const {
    return column_offsets != nullptr ? column_count : nonzero_count;
  }
};

/// A ContactBatchView without the numbers of rows and entries: a plan made from it depends on no value of these and on
/// no precision.
struct BatchStructure : BatchLayout, MatrixPattern {
  const Offset* mu_offsets = nullptr;  ///< where in mu the friction of each row is, where rows share it; null: at the
                                       ///< row                                       (row_count)
  Offset mu_count = 0;                 ///< length of mu where mu_offsets is given
  bool normal_last = false;  ///< rows of friction cones come tangential first and the normal last; environments that
                             ///< are not solved densely (choose_path) cannot be read so
  Index block_visits = 1;    ///< visits of the cones of one block before a sweep goes on (SolverOptions::blocks); above
                             ///< 1 cone_group holds their places, as the library writes them
  bool ends_early = false;   ///< in device memory: rows and cones end with the last environment's offsets, and the
                             ///< totals are room, as they are without counts

  /// Returns the index of a row's friction in mu.
  [[nodiscard]] STICTION_HD Offset mu_at(Offset row) const { return mu_offsets != nullptr ? mu_offsets[row] : row; }
  /// The normal row of a friction cone, the only row of any other.
  [[nodiscard]] STICTION_HD Offset normal_row(Offset cone) const {
    return normal_last ? cone_row_offsets[cone + 1] - 1 : cone_row_offsets[cone];
  }
  /// Columns of an environment's factor; 0 where A is stored.
  [[nodiscard]] STICTION_HD Index env_dofs(Offset env) const {
    if (factor_offsets == nullptr || env_rows(env) == 0) return 0;
    return static_cast<Index>((factor_offsets[env + 1] - factor_offsets[env]) / env_rows(env));
  }
};

/// Numbers of rows that bound their reactions, or give way to them.
template <class Real>
struct RowLimits {
  const Real* R = nullptr;   ///< compliance, >= 0 [w / lambda]                        (row_count)
  const Real* mu = nullptr;  ///< friction per axis, on a friction cone's rows after the first, boxed or not [-;
                             ///< torsional and rolling: m]; ignored elsewhere                   (row_count)
  const Real* lo =
      nullptr;  ///< lower bound of a box row; -1e20 and below: none [lambda]; ignored elsewhere (row_count)
  const Real* hi = nullptr;  ///< upper bound of a box row; 1e20 and above: none [lambda]; ignored elsewhere (row_count)
};

}  // namespace stiction
