#pragma once

#include <compare>
#include <cstdint>

#include "stiction/types.hpp"

namespace stiction {

/// Which form of the system an environment is solved in. It reaches floats (right-looking or coloured sweep), so it
/// is a function of that environment's structure alone.
enum class EnvPath : std::uint8_t {
  empty = 0,   ///< no rows
  dense = 1,   ///< A as a dense matrix, cones in canonical order, right-looking sweep
  sparse = 2,  ///< A as CSR, cones colour by colour, left-looking sweep
  factor = 3,  ///< A as Y Y', cones in file order, through the velocity Y' x
};

/// The path of an environment of n rows and nnz stored entries. It is dense while a dense sweep costs no more than a
/// gathered one: the matrix is small, or at least a quarter full. It is never dense where the matrix is so large that
/// the square would not fit.
STICTION_HD constexpr EnvPath choose_path(Offset n, Offset nnz) {
  if (n == 0) return EnvPath::empty;
  if (n <= 64) return EnvPath::dense;
  return n <= 1024 && 4 * nnz >= n * n ? EnvPath::dense : EnvPath::sparse;
}

/// The path of an environment that may have cones of semidefinite, which are never solved densely, since they are long
/// code. Packs and a GPU's small teams, which dense systems run on, stay without it.
STICTION_HD constexpr EnvPath choose_path(Offset n, Offset nnz, bool is_never_dense) {
  return is_never_dense && n > 0 ? EnvPath::sparse : choose_path(n, nnz);
}

/// Cones of each kind in an environment. In canonical order cones are sorted by kind and row count (free, unilateral,
/// box, friction of 2, 3, ... 6 rows). Boxed friction and semidefinite matrices have the rows and the place of a
/// friction cone. The sort is stable, so these counts give where every cone begins.
struct ConeCounts {
  Index free = 0;
  Index unilateral = 0;
  Index box = 0;
  Index friction[kMaxConeRows + 1] = {};  ///< of each row count m, all kinds of several rows; entries 0 and 1 stay zero
  Index box_friction = 0;                 ///< how many of those have boxed friction, of any row count
  Index semidefinite = 0;                 ///< how many of them are semidefinite matrices

  friend constexpr auto operator<=>(const ConeCounts&, const ConeCounts&) = default;
};

/// The shapes of cones in canonical order: free, unilateral, box, friction of 2, 3, ... 6 rows.
inline constexpr int kConeShapes = 2 + kMaxConeRows;
/// Rows of a cone of that shape.
STICTION_HD constexpr Index shape_rows(int shape) {
  return shape < 3 ? 1 : shape - 1;
}
/// The shape of a cone.
STICTION_HD constexpr int shape_of(ConeKind kind, Index rows) {
  return kind >= ConeKind::friction ? static_cast<int>(rows) + 1 : static_cast<int>(kind);
}
/// Returns the number of cones.
STICTION_HD constexpr Index shape_count(const ConeCounts& counts, int shape) {
  if (shape >= 3) return counts.friction[shape - 1];
  return shape == 0 ? counts.free : shape == 1 ? counts.unilateral : counts.box;
}

/// Rows tiled by those cones.
STICTION_HD constexpr Index row_count(const ConeCounts& counts) {
  Index rows = counts.free + counts.unilateral + counts.box;
  for (Index m = 2; m <= kMaxConeRows; ++m) rows += m * counts.friction[m];
  return rows;
}

/// Cones in all.
STICTION_HD constexpr Index cone_count(const ConeCounts& counts) {
  Index cones = counts.free + counts.unilateral + counts.box;
  for (Index m = 2; m <= kMaxConeRows; ++m) cones += counts.friction[m];
  return cones;
}

}  // namespace stiction
