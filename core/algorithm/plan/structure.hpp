#pragma once

#include <limits>

#include "core/job/cone_blocks.hpp"
#include "core/job/cone_counts.hpp"
#include "core/team/phases.hpp"
#include "stiction/batch_structure.hpp"

namespace stiction::inline STICTION_ISA {

/// Most rows, cones or stored entries of one environment, with all room between them: the limit of Index.
inline constexpr Offset kMostOfOneEnv = std::numeric_limits<Index>::max();

/// The integers of one environment, and no number: a plan made from them cannot depend on a value. Rows and cones
/// count from the environment's own zero.
struct StructureView {
  Index rows;
  Index cones;
  Offset first_row;              ///< this environment's first row in the batch
  const ConeKind* kind;          ///< kind                                                        (cones)
  const Offset* cone_rows;       ///< batch-wide first row of each cone                           (cones + 1)
  const Index* group;            ///< manifold of each cone, or null; with blocks block_place()   (cones)
  bool has_blocks;               ///< cones are swept in blocks
  const Offset* row_offsets;     ///< CSR rows, batch-wide positions                              (rows + 1)
  const Index* row_counts;       ///< entries in use of each row, or null: up to the next row's   (rows)
  const Offset* column_offsets;  ///< where each row's columns begin                              (rows)
  const Index* column;           ///< CSR columns, the whole batch's array

  [[nodiscard]] STICTION_HD Index cone_row(Index cone) const { return static_cast<Index>(cone_rows[cone] - first_row); }
  [[nodiscard]] STICTION_HD Index cone_size(Index cone) const {
    return static_cast<Index>(cone_rows[cone + 1] - cone_rows[cone]);
  }
  /// Stored entries of a row, and their columns.
  [[nodiscard]] STICTION_HD Index entries(Index row) const {
    return row_counts != nullptr ? row_counts[row] : static_cast<Index>(row_offsets[row + 1] - row_offsets[row]);
  }
  [[nodiscard]] STICTION_HD const Index* columns(Index row) const { return column + column_offsets[row]; }
  /// Returns the first entry of a row's room, counted from the environment's first.
  [[nodiscard]] STICTION_HD Index entry_begin(Index row) const {
    return static_cast<Index>(row_offsets[row] - row_offsets[0]);
  }
  /// Room of all entries.
  [[nodiscard]] STICTION_HD Index entry_span() const { return entry_begin(rows); }
};

/// One environment of a batch whose structure is sound there.
STICTION_HD StructureView structure_of(const BatchStructure& batch, Offset env) {
  const Offset row = batch.env_row_offsets[env], cone = batch.env_cone_offsets[env];
  StructureView s;
  s.rows = batch.env_rows(env);
  s.cones = batch.env_cones(env);
  s.first_row = row;
  s.kind = batch.cone_kind + cone;
  s.cone_rows = batch.cone_row_offsets + cone;
  s.group = batch.cone_group == nullptr ? nullptr : batch.cone_group + cone;
  s.has_blocks = batch.block_visits > 1;
  s.row_offsets = batch.row_offsets + row;
  s.row_counts = batch.row_counts == nullptr ? nullptr : batch.row_counts + row;
  s.column_offsets = (batch.column_offsets == nullptr ? batch.row_offsets : batch.column_offsets) + row;
  s.column = batch.column;
  return s;
}

/// Returns true if some cone is of that kind, on every lane.
template <Team TeamT>
STICTION_HD bool has_kind(TeamT& team, const StructureView& s, ConeKind kind) {
  std::uint32_t found = 0;
  for (Index cone = team.rank(); cone < s.cones; cone += team.size()) found |= s.kind[cone] == kind ? 1U : 0U;
  return team.combine(found) != 0;
}

/// The path of an environment whose A is stored, on every lane. Entries are counted only where they can matter.
template <Team TeamT>
STICTION_HD EnvPath path_of(TeamT& team, const StructureView& s) {
  Offset entries = s.entry_span();
  if (s.row_counts != nullptr && choose_path(s.rows, 0) != choose_path(s.rows, Offset{s.rows} * s.rows)) {
    entries = 0;
    for (Index row = 0; row < s.rows; ++row) entries += s.row_counts[row];
  }
  return choose_path(s.rows, entries, has_kind(team, s, ConeKind::semidefinite));
}

/// Returns true if offsets[at], offsets[at + 1] bound a part of `total` things. They have to be in range and in order.
/// The first and the last of all `count` parts begin and end where the things do.
STICTION_HD bool is_part(const Offset* offsets, Offset at, Offset count, Offset total) {
  const Offset begin = offsets[at], end = offsets[at + 1];
  return begin >= 0 && begin <= end && end <= total && (at != 0 || begin == 0) && (at + 1 != count || end == total);
}

/// Returns how much of one environment's room for rows, or cones, is in use; -1 if that is unknown.
STICTION_HD Index part_in_use(const Offset* offsets, const Index* counts, Offset env, Offset env_count, Offset total) {
  if (!is_part(offsets, env, env_count, total)) return -1;
  const Offset room = offsets[env + 1] - offsets[env];
  if (room > kMostOfOneEnv) return -1;
  if (counts == nullptr) return static_cast<Index>(room);
  return counts[env] <= room ? counts[env] : -1;
}

/// Returns true if the columns of a batch's row lie within the array of columns.
STICTION_HD bool has_columns(const BatchStructure& batch, Offset row) {
  if (!is_part(batch.row_offsets, row, batch.row_count, batch.nonzero_count)) return false;
  const Offset room = batch.row_offsets[row + 1] - batch.row_offsets[row];
  const Offset count = batch.row_counts == nullptr ? room : batch.row_counts[row];
  if (count < 0 || count > room) return false;
  if (batch.column_offsets == nullptr) return true;
  return batch.column_offsets[row] >= 0 && batch.column_offsets[row] <= batch.column_count - count;
}

/// Entries in use of some rows.
STICTION_HD Offset stored_entries(const BatchStructure& batch, Offset row, Index rows) {
  if (batch.row_counts == nullptr) return batch.row_offsets[row + rows] - batch.row_offsets[row];
  Offset entries = 0;
  for (Index i = 0; i < rows; ++i) entries += batch.row_counts[row + i];
  return entries;
}

/// Returns true if a factor has as many entries in every row of its environment, and takes the place of stored ones.
STICTION_HD bool has_sound_factor(const BatchStructure& batch, Offset env, Index rows, Offset stored) {
  if (batch.factor_offsets == nullptr) return true;
  if (!is_part(batch.factor_offsets, env, batch.env_count, batch.factor_count)) return false;
  const Offset entries = batch.factor_offsets[env + 1] - batch.factor_offsets[env];
  return entries == 0 || (rows > 0 && stored == 0 && entries % rows == 0 && entries / rows <= kMostOfOneEnv);
}

/// Returns true if the friction of a cone's rows lies within the array of friction.
STICTION_HD bool has_friction(const BatchStructure& batch, Offset cone) {
  if (batch.mu_offsets == nullptr || !carries_friction(batch.cone_kind[cone])) return true;
  for (Offset row = batch.cone_row_offsets[cone]; row < batch.cone_row_offsets[cone + 1]; ++row) {
    if (row == batch.normal_row(cone)) continue;
    if (batch.mu_offsets[row] < 0 || batch.mu_offsets[row] >= batch.mu_count) return false;
  }
  return true;
}

/// Returns true if environment `env` can be planned and solved. Its offsets are in order and within the batch's
/// totals, and its rows and entries are within its room. Its rows are tiled by cones of legal sizes, its columns
/// inside. The totals and which arrays are null are believed, nothing in the arrays is. No entry is used as a position
/// before it was compared with a total. All environments (one at least) are sound if and only if validate() finds no
/// structural defect in the batch. The answer is on every lane.
template <Team TeamT>
STICTION_HD_OUTLINE bool structure_is_sound(TeamT& team, const BatchStructure& batch, Offset env) {
  const Index rows = part_in_use(batch.env_row_offsets, batch.env_row_counts, env, batch.env_count, batch.row_count);
  const Index cones =
      part_in_use(batch.env_cone_offsets, batch.env_cone_counts, env, batch.env_count, batch.cone_count);
  if (rows < 0 || cones < 0) return false;
  const Offset row = batch.env_row_offsets[env], row_end = batch.env_row_offsets[env + 1];
  const Offset cone = batch.env_cone_offsets[env], cone_end = batch.env_cone_offsets[env + 1];
  if (batch.cone_row_offsets[cone] != row || batch.cone_row_offsets[cone + cones] != row + rows) return false;
  // Offsets that no cone or row of the environment begins or ends at, if it is the last or has none.
  if (cone_end == batch.cone_count && batch.cone_row_offsets[cone_end] != batch.row_count) return false;
  if (row == 0 && batch.row_offsets[0] != 0) return false;
  if (row_end == batch.row_count && batch.row_offsets[row_end] != batch.nonzero_count) return false;

  std::uint32_t broken = 0;
  const auto expect = [&](bool holds) { broken |= static_cast<std::uint32_t>(!holds); };
  for_each(team, static_cast<Index>(cone_end - cone), [&](Index c) {
    const Offset begin = batch.cone_row_offsets[cone + c], end = batch.cone_row_offsets[cone + c + 1];
    const bool in_order = begin >= 0 && begin <= end && end <= batch.row_count;
    // Rows of a matrix have one order, with the normal last or not.
    expect(in_order && (c >= cones || (begin >= row && is_cone(batch.cone_kind[cone + c], end - begin) &&
                                       !(batch.normal_last && batch.cone_kind[cone + c] == ConeKind::semidefinite))));
  });
  for_each(team, static_cast<Index>(row_end - row), [&](Index i) { expect(has_columns(batch, row + i)); });
  if (team.combine(broken) != 0) return false;
  if (batch.row_offsets[row + rows] - batch.row_offsets[row] > kMostOfOneEnv) return false;

  // Only dense systems are put into another order, in which the normal can come first.
  const Offset stored = stored_entries(batch, row, rows);
  if (!has_sound_factor(batch, env, rows, stored)) return false;
  if (batch.normal_last && rows > 0 && (batch.env_dofs(env) > 0 || choose_path(rows, stored) != EnvPath::dense))
    return false;
  for_each(team, cones, [&](Index c) { expect(has_friction(batch, cone + c)); });
  for_each(team, rows, [&](Index i) {
    const Index* const columns = batch.row_columns(row + i);
    const Index count = batch.row_entries(row + i);
    for (Index k = 0; k < count; ++k) expect(columns[k] >= 0 && columns[k] < rows);
  });
  return team.combine(broken) == 0;
}

}  // namespace stiction::inline STICTION_ISA
