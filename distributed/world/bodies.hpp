#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/machine/world_arrays.hpp"
#include "core/runtime/world/world_model.hpp"

/// Bodies and contacts of one rank of a world that no rank holds as a whole (docs/howto/ranks.md).
namespace stiction::distributed {

/// State of one body that the next step depends on: shapes and units of WorldCheckpoint.
template <class Real>
struct BodyNumbers {
  Real position[3], orientation[4], twist[6], wrench[6];
};

/// A body where World::reset() puts it; `orientation` is normalised.
template <class Real>
BodyNumbers<Real> numbers_at(std::span<const Real, 3> position, std::span<const Real, 4> orientation,
                             std::span<const Real, 6> twist);

/// Bodies first .. end - 1.
struct BodyRange {
  Index first, end;
  [[nodiscard]] bool has(Index body) const { return first <= body && body < end; }
};

/// The part of that many bodies' numbers that a rank has where numbers alone decide.
inline BodyRange share_of(Index bodies, int rank, int ranks) {
  const auto begin = [&](int r) { return static_cast<Index>(Offset{bodies} * r / ranks); };
  return {begin(rank), begin(rank + 1)};
}

/// The rank whose share a body is in.
inline int rank_with(Index body, Index bodies, int ranks) {
  auto rank = static_cast<int>(Offset{body} * ranks / bodies);  // or, by rounding, one before it
  while (!share_of(bodies, rank, ranks).has(body)) ++rank;
  return rank;
}

/// Bodies by number, ascending.
template <class Real>
struct BodyList {
  std::vector<Index> body;
  std::vector<BodyNumbers<Real>> numbers;

  [[nodiscard]] std::size_t size() const { return body.size(); }
  void add(Index number, const BodyNumbers<Real>& of) {
    body.push_back(number);
    numbers.push_back(of);
  }
};

/// End states of contacts, by id, ascending.
template <class Real>
struct Impulses {
  std::vector<std::uint64_t> id;
  std::vector<Real> impulse;  ///< (3 * contacts)
};

/// By number.
template <class Real>
BodyList<Real> sorted(const BodyList<Real>& from);
/// By id, each once. Two ranks know the final impulse of a contact between them, and know the same.
template <class Real>
Impulses<Real> sorted(const Impulses<Real>& from);

/// Some bodies of a world as a world of their own, with all shapes of the world that stands still.
template <class Real>
class PartOfWorld {
 public:
  /// `bodies` ascend.
  PartOfWorld(const WorldModelView<Real>& whole, const BodyList<Real>& bodies);
  PartOfWorld(const PartOfWorld&) = delete;
  PartOfWorld& operator=(const PartOfWorld&) = delete;

  [[nodiscard]] const WorldModel<Real>& model() const { return model_; }
  [[nodiscard]] WorldArrays<Real>& arrays() { return arrays_; }
  [[nodiscard]] const WorldArrays<Real>& arrays() const { return arrays_; }
  [[nodiscard]] BodyNumbers<Real> numbers(std::size_t k) const;

 private:
  WorldModel<Real> model_;
  WorldArrays<Real> arrays_;
};

/// f(numbers in a row, the array of each), over the fields that BodyNumbers and WorldArrays share.
template <class F, class... Each>
void for_each_number(F&& f, Each&... each) {
  f(std::size_t{3}, each.position...);
  f(std::size_t{4}, each.orientation...);
  f(std::size_t{6}, each.twist...);
  f(std::size_t{6}, each.wrench...);
}

}  // namespace stiction::distributed
