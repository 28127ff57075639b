#pragma once

/// \file
/// Arrays of fixed room per environment, read where they are (docs/howto/jacobian.md).

#include <cstdint>
#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// Order of a padded matrix's rows.
enum class MatrixRows : std::uint8_t {
  by_room,  ///< row i begins at i * room, as in arrays of shape (environments, room, room): MuJoCo Warp
  by_rows,  ///< row i begins at i * rows, a dense rows x rows matrix at the beginning of its room: Newton Kamino
};

/// Position of a friction cone's normal row.
enum class RowOrder : std::uint8_t {
  normal_first,  ///< before the tangential rows
  normal_last,   ///< behind the tangential rows: Newton Kamino
};

/// Numbers of a padded batch: the caller's arrays, which are neither copied nor changed. Vectors of an environment
/// take `room` entries, its matrix room * room, and environments follow one another. Numbers behind the entries in use
/// may be anything.
template <class Real>
struct PaddedNumbers {
  const Real* A = nullptr;   ///< dense Delassus operators, without R [w / lambda]   (sum of room^2)
  const Real* b = nullptr;   ///< right-hand side [w]                                (sum of room)
  const Real* R = nullptr;   ///< compliance, >= 0 [w / lambda]                      (sum of room)
  const Real* mu = nullptr;  ///< friction per axis, as in ContactBatchView, or per contact [-]
  const Real* lo = nullptr;  ///< lower bounds of box rows [lambda]                  (sum of room)
  const Real* hi = nullptr;  ///< upper bounds of box rows [lambda]                  (sum of room)
};

/// The integers of a padded batch: those of a ContactBatchView beside the caller's numbers. Rows of an environment are
/// those of its cones, in order, from the beginning of its room.
template <class Real>
class PaddedLayout {
 public:
  /// One cone, as of an Environment.
  using Cone = typename Environment<Real>::Cone;

  /// A layout without environments.
  explicit PaddedLayout(MatrixRows matrix_rows, RowOrder row_order = RowOrder::normal_first)
      : matrix_rows_(matrix_rows), row_order_(row_order) {}

  /// Appends one environment with room for `room` rows. Cones from the first that does not fit on are left out, and
  /// the environment is marked kFlagContactsDropped. It is flagged, too, if `overflowed`: its producer had to leave
  /// contacts out. `first_mu` >= 0: mu has one entry per friction cone, those of this environment from that place on,
  /// in order; for all environments or none. \throws Error(invalid_argument) on a negative room or a cone without
  /// rows; then nothing was appended.
  void add(Index room, std::span<const Cone> cones, bool overflowed = false, Offset first_mu = -1);

  /// Environments so far.
  [[nodiscard]] Offset env_count() const noexcept { return static_cast<Offset>(env_flags_.size()); }
  /// Length of the vectors, and of a solution's lambda and w.
  [[nodiscard]] Offset row_count() const noexcept { return env_row_offsets_.back(); }
  /// Rows of an environment that are solved: those of the cones that fit.
  [[nodiscard]] Index rows(Offset env) const { return env_row_counts_.at(static_cast<std::size_t>(env)); }

  /// The batch over those numbers, in host memory; valid while the layout lives and is not appended to.
  [[nodiscard]] ContactBatchView<Real> view(const PaddedNumbers<Real>& numbers, Law law) const noexcept;

 private:
  MatrixRows matrix_rows_;
  RowOrder row_order_;
  Offset mu_count_ = 0;
  std::vector<Offset> env_row_offsets_{0}, env_cone_offsets_{0}, cone_row_offsets_{0}, row_offsets_{0};
  std::vector<Index> env_row_counts_, env_cone_counts_, cone_group_, row_counts_, column_;
  std::vector<std::uint32_t> env_flags_;
  std::vector<ConeKind> cone_kind_;
  std::vector<Offset> column_offsets_, mu_offsets_;
};

}  // namespace stiction
