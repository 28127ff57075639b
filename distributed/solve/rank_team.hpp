#pragma once

#include <cstring>
#include <type_traits>

#include "core/algorithm/rigid/ranked_bodies.hpp"
#include "distributed/solve/halo.hpp"

namespace stiction::inline STICTION_ISA {

/// A rank as an algorithm's team of one lane. Maxima and flags are folded over all ranks, in their order.
class RankTeam {
 public:
  static constexpr Index kRowTile = SerialTeam::kRowTile;

  explicit RankTeam(distributed::Halo& halo) : halo_(&halo) {}

  static constexpr Index rank() { return 0; }
  static constexpr Index size() { return 1; }
  void sync() const {}
  template <class F>
  auto broadcast(F&& f) const {
    return f();
  }
  std::uint32_t combine(std::uint32_t bits) {
    return fold(bits, [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }
  template <class T>
  T max(T value) {
    return fold(value, [](T a, T b) { return max_(a, b); });
  }
  template <class T>
  T* leaves() const {
    return nullptr;
  }
  template <class Real>
  void share(Index round, Real* rows, Index width) {
    halo_->share(round, rows, width);
  }

 private:
  template <class T, class F>
  T fold(T value, F&& join) {
    static_assert(std::is_trivially_copyable_v<T>);
    const std::byte* all = halo_->gather(&value, sizeof(T));
    const auto of = [&](int rank) {
      T one;
      std::memcpy(&one, all + static_cast<std::size_t>(rank) * sizeof(T), sizeof(T));
      return one;
    };
    T joined = of(0);
    for (int rank = 1; rank < halo_->size(); ++rank) joined = join(of(rank), joined);
    return joined;
  }

  distributed::Halo* halo_;
};

static_assert(RankedTeam<RankTeam>);

}  // namespace stiction::inline STICTION_ISA
