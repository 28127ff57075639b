#pragma once

#include <map>

#include "stiction/types.hpp"

namespace stiction::graph {

/// Counts each value's occurrences, for the least and the most of values that come and go. O(log distinct values) each.
class Tally {
 public:
  void add(Offset value) { ++times_[value]; }
  void remove(Offset value) {
    const auto found = times_.find(value);
    if (--found->second == 0) times_.erase(found);
  }
  void replace(Offset before, Offset after) {
    if (before == after) return;
    remove(before);
    add(after);
  }
  void clear() { times_.clear(); }
  /// The least and the most, or `none`.
  [[nodiscard]] Offset least(Offset none) const { return times_.empty() ? none : times_.begin()->first; }
  [[nodiscard]] Offset most(Offset none) const { return times_.empty() ? none : times_.rbegin()->first; }

 private:
  std::map<Offset, Offset> times_;
};

}  // namespace stiction::graph
