#include <algorithm>
#include <tuple>

#include "core/plan/ordering_algorithms.hpp"

namespace stiction {
namespace {

/// Searches in breadth over the rows that have not been taken, nearest to the start first, then in the order of
/// discovery. Neighbours of one row go by degree, then by number. Writes them behind `order` and returns how far the
/// last one is.
class BreadthSearch {
 public:
  explicit BreadthSearch(const BlockPattern& pattern)
      : pattern_(pattern), seen_(static_cast<std::size_t>(pattern.rows), 0) {}

  Index run(Index start, std::vector<Index>& order) {
    const std::size_t first = order.size();
    ++search_;
    mark(start);
    order.push_back(start);
    Index depth = -1;
    for (std::size_t next = first; next < order.size(); ++depth)
      for (const std::size_t end = order.size(); next < end; ++next) visit(order[next], order);
    return depth;
  }

  [[nodiscard]] Index degree(Index row) const { return pattern_.offsets[row + 1] - pattern_.offsets[row]; }
  [[nodiscard]] bool is_seen(Index row) const { return seen_[static_cast<std::size_t>(row)] != 0; }

 private:
  void mark(Index row) { seen_[static_cast<std::size_t>(row)] = search_; }
  void visit(Index row, std::vector<Index>& order) {
    const auto first = static_cast<std::ptrdiff_t>(order.size());
    for (Index k = pattern_.offsets[row]; k < pattern_.offsets[row + 1]; ++k) {
      const Index other = pattern_.columns[k];
      if (seen_[static_cast<std::size_t>(other)] == search_) continue;
      mark(other);
      order.push_back(other);
    }
    std::sort(order.begin() + first, order.end(),
              [&](Index a, Index b) { return std::make_tuple(degree(a), a) < std::make_tuple(degree(b), b); });
  }

  BlockPattern pattern_;
  std::vector<Index> seen_;  ///< the last search that came by
  Index search_ = 0;
};

}  // namespace

/// Each part that hangs together begins at a row that is as far from some other as searches find. After one has ended,
/// the next begins, as long as that goes farther (George and Liu 1979).
std::vector<Index> order_cuthill_mckee(const BlockPattern& pattern) {
  BreadthSearch search(pattern);
  std::vector<Index> order;
  for (Index seed = 0; seed < pattern.rows; ++seed) {
    if (search.is_seen(seed)) continue;
    const auto first = static_cast<std::ptrdiff_t>(order.size());
    Index start = seed;
    for (Index before = -1, depth = search.run(start, order); depth > before;) {
      start = order.back();
      order.resize(static_cast<std::size_t>(first));
      before = depth;
      depth = search.run(start, order);
    }
  }
  std::reverse(order.begin(), order.end());
  return order;
}

}  // namespace stiction
