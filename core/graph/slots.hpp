#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "stiction/types.hpp"

namespace stiction::graph {

inline std::size_t at(Offset i) {
  return static_cast<std::size_t>(i);
}

/// Values that keep their slot while they live; slots that were given back are used again.
template <class T>
class Slots {
 public:
  Index add(T value) {
    if (free_.empty()) {
      values_.push_back(std::move(value));
      return static_cast<Index>(values_.size()) - 1;
    }
    const Index slot = free_.back();
    free_.pop_back();
    values_[at(slot)] = std::move(value);
    return slot;
  }
  void remove(Index slot) {
    values_[at(slot)] = T{};
    free_.push_back(slot);
  }
  void clear() {
    values_.clear();
    free_.clear();
  }
  T& operator[](Index slot) { return values_[at(slot)]; }
  const T& operator[](Index slot) const { return values_[at(slot)]; }
  /// One more than the largest slot in use; some below may be free.
  [[nodiscard]] Index end() const { return static_cast<Index>(values_.size()); }
  [[nodiscard]] Offset count() const { return static_cast<Offset>(values_.size() - free_.size()); }

 private:
  std::vector<T> values_;
  std::vector<Index> free_;
};

}  // namespace stiction::graph
