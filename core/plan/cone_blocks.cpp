#include "core/plan/cone_blocks.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/base/extents.hpp"
#include "core/job/cone_blocks.hpp"

namespace stiction {

namespace {

/// Coupling of two rows, A_ij^2 over the diagonal entries of A + diag R, from which on their cones are of one block.
constexpr double kStrong = 0.25;

/// One environment of a batch, for blocks of its cones. Cones and rows count from the environment's own zero.
template <class Real>
class BlocksOfEnv {
 public:
  /// `groups`: of the whole batch.
  BlocksOfEnv(const ContactBatchView<Real>& batch, Offset env, std::vector<Index>& groups)
      : batch_(batch),
        first_row_(batch.env_row_offsets[env]),
        first_cone_(batch.env_cone_offsets[env]),
        rows_(batch.env_rows(env)),
        cones_(batch.env_cones(env)),
        groups_(groups.data() + first_cone_) {}

  void write(BlockMode mode) { mode == BlockMode::pairs ? write_pairs() : write_strong(); }

 private:
  [[nodiscard]] Index row_of(Index cone) const {
    return static_cast<Index>(batch_.cone_row_offsets[first_cone_ + cone] - first_row_);
  }
  [[nodiscard]] Index rows_of(Index cone) const { return row_of(cone + 1) - row_of(cone); }

  /// Cones of one manifold, by their numbers. Each joins the block of the one before it, or begins another
  /// when that is full.
  void write_pairs() {
    struct Open {
      Index first, rows;
    };
    std::unordered_map<Index, Open> blocks;  // of each manifold, the last one
    for (Index cone = 0; cone < cones_; ++cone) {
      groups_[cone] = cone;
      const Index manifold = manifold_of(cone);
      if (manifold < 0) continue;
      const auto [found, is_new] = blocks.try_emplace(manifold, Open{cone, 0});
      Open& block = found->second;
      if (block.rows + rows_of(cone) > kMostBlockRows) block = {cone, 0};
      block.rows += rows_of(cone);
      groups_[cone] = block.first;
    }
  }

  /// Returns the number that all cones of one pair of bodies share, -1 for a cone without others.
  [[nodiscard]] Index manifold_of(Index cone) {
    if (batch_.cone_group != nullptr) return batch_.cone_group[first_cone_ + cone];
    const Offset row = first_row_ + row_of(cone);
    const Index* const column = batch_.row_columns(row);
    const Index count = batch_.row_entries(row);
    std::uint64_t hash = 0xCBF29CE484222325ULL;
    for (Index k = 0; k < count; ++k) hash = (hash ^ static_cast<std::uint64_t>(column[k])) * 0x100000001B3ULL;
    for (const Index like : seen_[hash]) {
      const Offset other = first_row_ + row_of(like);
      if (count == batch_.row_entries(other) && std::equal(column, column + count, batch_.row_columns(other)))
        return like;
    }
    seen_[hash].push_back(cone);
    return cone;
  }

  /// Blocks that grow one after the other, each from the lowest number that is in none yet. A block takes the
  /// cone that is coupled to it the most, as long as one is coupled strongly and has room. The lower number
  /// comes first among equals.
  void write_strong() {
    find_diagonal();
    std::fill(groups_, groups_ + cones_, -1);
    coupling_.assign(at(cones_), 0.0);
    is_strong_.assign(at(cones_), 0);
    for (Index seed = 0; seed < cones_; ++seed) {
      if (groups_[seed] >= 0) continue;
      Index room = kMostBlockRows;
      for (Index next = seed; next >= 0; next = strongest(room)) {
        groups_[next] = seed;
        room -= rows_of(next);
        meet(next);
      }
      for (const Index cone : met_) {
        coupling_[at(cone)] = 0.0;
        is_strong_[at(cone)] = 0;
      }
      met_.clear();
    }
  }

  /// Adds the squared couplings of a new member, of all its rows.
  void meet(Index member) {
    for (Index row = row_of(member); row < row_of(member + 1); ++row) {
      const Index* const column = batch_.row_columns(first_row_ + row);
      const Real* const value = batch_.A + batch_.row_offsets[first_row_ + row];
      for (Index k = 0; k < batch_.row_entries(first_row_ + row); ++k) {
        const Index cone = cone_of_row_[at(column[k])];
        const double scale = diagonal_[at(row)] * diagonal_[at(column[k])];
        const double square = static_cast<double>(value[k]) * static_cast<double>(value[k]);
        if (groups_[cone] >= 0 || !(scale > 0 && square > 0)) continue;
        if (coupling_[at(cone)] == 0.0) met_.push_back(cone);
        coupling_[at(cone)] += square / scale;
        if (square >= kStrong * scale) is_strong_[at(cone)] = 1;
      }
    }
  }

  /// Returns the cone to take next, or -1.
  [[nodiscard]] Index strongest(Index room) const {
    Index best = -1;
    for (const Index cone : met_) {
      if (is_strong_[at(cone)] == 0 || groups_[cone] >= 0 || rows_of(cone) > room) continue;
      const double more = best < 0 ? 1.0 : coupling_[at(cone)] - coupling_[at(best)];
      if (more > 0 || (more == 0 && cone < best)) best = cone;
    }
    return best;
  }

  void find_diagonal() {
    diagonal_.assign(at(rows_), 0.0);
    cone_of_row_.resize(at(rows_));
    for (Index cone = 0; cone < cones_; ++cone) std::fill_n(cone_of_row_.begin() + row_of(cone), rows_of(cone), cone);
    for (Index i = 0; i < rows_; ++i) {
      const Index* const column = batch_.row_columns(first_row_ + i);
      const Index count = batch_.row_entries(first_row_ + i);
      const Index* const found = std::find(column, column + count, i);
      if (found != column + count)
        diagonal_[at(i)] = static_cast<double>(batch_.A[batch_.row_offsets[first_row_ + i] + (found - column)]);
      diagonal_[at(i)] += static_cast<double>(batch_.R[first_row_ + i]);
    }
  }

  const ContactBatchView<Real>& batch_;
  Offset first_row_, first_cone_;
  Index rows_, cones_;
  Index* groups_;
  std::vector<double> diagonal_;                                ///< of A + diag R, by row
  std::vector<Index> cone_of_row_;                              ///< by row
  std::vector<double> coupling_;                                ///< to the block being made, squares added up, by cone
  std::vector<unsigned char> is_strong_;                        ///< some row of it is coupled strongly, by cone
  std::vector<Index> met_;                                      ///< cones where coupling_ is not 0
  std::unordered_map<std::uint64_t, std::vector<Index>> seen_;  ///< cones whose columns are new, by their hash
};

}  // namespace

template <class Real>
std::vector<Index> block_groups(const ContactBatchView<Real>& batch, BlockMode mode, const ParallelFor& parallel_for) {
  std::vector<Index> groups(static_cast<std::size_t>(batch.cone_count), -1);
  parallel_for(batch.env_count, [&](Offset begin, Offset end) {
    for (Offset env = begin; env < end; ++env)
      if (batch.env_dofs(env) == 0) BlocksOfEnv<Real>(batch, env, groups).write(mode);
  });
  return groups;
}

template std::vector<Index> block_groups(const ContactBatchView<float>&, BlockMode, const ParallelFor&);
template std::vector<Index> block_groups(const ContactBatchView<double>&, BlockMode, const ParallelFor&);

}  // namespace stiction
