#include "core/plan/block_factor_plan.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>

#include "core/base/extents.hpp"
#include "core/plan/block_tables.hpp"

namespace stiction {
namespace {

/// H with its rows in the order of elimination.
class Elimination {
 public:
  Elimination(const BlockPattern& pattern, std::span<const Index> order)
      : pattern_(pattern), order_(order), position_(at(pattern.rows), -1) {
    if (order.size() != position_.size()) refuse(static_cast<Index>(order.size()));
    for (Index k = 0; k < pattern.rows; ++k) {
      const Index row = order[at(k)];
      if (row < 0 || row >= pattern.rows || position_[at(row)] >= 0) refuse(k);
      position_[at(row)] = k;
    }
  }

  [[nodiscard]] Index rows() const { return pattern_.rows; }

  /// f(k) for every position k before i that H couples to i.
  template <class F>
  void for_each_before(Index i, F&& f) const {
    const Index row = order_[at(i)];
    for (Index k = pattern_.offsets[row]; k < pattern_.offsets[row + 1]; ++k) {
      const Index other = position_[at(pattern_.columns[k])];
      if (other < i) f(other);
    }
  }

 private:
  [[noreturn]] static void refuse(Index k) {
    throw Error(ErrorCode::invalid_argument, "order is no permutation of the pattern's rows at entry " +
                                                 std::to_string(k) + "; order_rows() makes one");
  }

  BlockPattern pattern_;
  std::span<const Index> order_;
  std::vector<Index> position_;
};

/// The parent of every position in the elimination tree, -1 for roots (Liu 1990, algorithm 4.2: with path compression).
std::vector<Index> elimination_tree(const Elimination& H) {
  std::vector<Index> parent(at(H.rows()), -1);
  std::vector<Index> ancestor(at(H.rows()), -1);
  for (Index i = 0; i < H.rows(); ++i)
    H.for_each_before(i, [&](Index k) {
      while (k != -1 && k < i) {
        const Index next = ancestor[at(k)];
        ancestor[at(k)] = i;
        if (next == -1) parent[at(k)] = i;
        k = next;
      }
    });
  return parent;
}

/// The columns of L before the diagonal, row by row, not sorted.
class FactorRows {
 public:
  FactorRows(const Elimination& H, Fill fill) : H_(H), fill_(fill), seen_(at(H.rows()), -1) {
    if (fill == Fill::complete) parent_ = elimination_tree(H);
  }

  /// Calls f(k) once for every k < i with a block (i, k). With fill, these are the nodes of the tree on the way from
  /// H's blocks to i.
  template <class F>
  void for_each_before(Index i, F&& f) {
    if (fill_ == Fill::none) return H_.for_each_before(i, f);
    seen_[at(i)] = i;
    H_.for_each_before(i, [&](Index k) {
      for (; seen_[at(k)] != i; k = parent_[at(k)]) {
        seen_[at(k)] = i;
        f(k);
      }
    });
  }

 private:
  const Elimination& H_;
  Fill fill_;
  std::vector<Index> parent_;
  std::vector<Index> seen_;  ///< the last row that came by
};

}  // namespace

void append_block_factor(std::vector<Index>& stream, const BlockPattern& pattern, std::span<const Index> order,
                         Fill fill) {
  expect_diagonal(pattern);
  const Index rows = pattern.rows;
  const Elimination H(pattern, order);
  FactorRows L(H, fill);

  Offset blocks = rows;
  Index level_count = rows > 0 ? 1 : 0;
  std::vector<Index> level(at(rows), 0);
  for (Index i = 0; i < rows; ++i) {
    L.for_each_before(i, [&](Index k) {
      level[at(i)] = larger_of(level[at(i)], level[at(k)] + 1);
      ++blocks;
    });
    level_count = larger_of(level_count, level[at(i)] + 1);
  }
  if (blocks > std::numeric_limits<Index>::max())
    throw Error(ErrorCode::out_of_memory, "a factor of " + std::to_string(blocks) +
                                              " blocks is more than an Index counts; choose another ordering, or a "
                                              "preconditioner without fill");

  std::vector<Index> level_offsets(at(level_count) + 1, 0);
  for (const Index l : level) ++level_offsets[at(l) + 1];
  std::partial_sum(level_offsets.begin(), level_offsets.end(), level_offsets.begin());
  std::vector<Index> rank(at(rows));    // position by level of each position
  std::vector<Index> sorted(at(rows));  // and the other way round
  std::vector<Index> next(level_offsets.begin(), level_offsets.end());
  for (Index i = 0; i < rows; ++i) {
    rank[at(i)] = next[at(level[at(i)])]++;
    sorted[at(rank[at(i)])] = i;
  }

  std::vector<Index> offsets{0};
  std::vector<Index> columns;
  std::vector<Index> sources;
  offsets.reserve(at(rows) + 1);
  columns.reserve(static_cast<std::size_t>(blocks));
  sources.reserve(static_cast<std::size_t>(blocks));
  for (const Index i : sorted) {
    L.for_each_before(i, [&](Index k) { columns.push_back(rank[at(k)]); });
    std::sort(columns.begin() + offsets.back(), columns.end());
    columns.push_back(rank[at(i)]);
    for (auto k = at(offsets.back()); k < columns.size(); ++k)
      sources.push_back(find_block(pattern, order[at(i)], order[at(sorted[at(columns[k])])]));
    offsets.push_back(static_cast<Index>(columns.size()));
  }

  stream.push_back(level_count);
  append_table(stream, level_offsets);
  append_pattern(stream, rows, offsets, columns);
  for (const Index i : sorted) stream.push_back(order[at(i)]);
  append_table(stream, sources);
  append_columns(stream, offsets, columns, false);
}

}  // namespace stiction
