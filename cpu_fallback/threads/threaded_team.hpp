#pragma once

#include <cstring>
#include <type_traits>

#include "core/team/team.hpp"
#include "cpu_fallback/threads/shared_numbers.hpp"
#include "cpu_fallback/threads/thread_team.hpp"

namespace stiction::inline STICTION_ISA {

/// A Team whose lanes are CPU threads: one large environment on several cores.
class ThreadedTeam {
 public:
  /// Long runs of neighbours, so that threads do not write to each other's cache lines.
  static constexpr Index kRowTile = 128;

  /// Numbers that threads read and change without meeting.
  template <class T, int kCount>
  using Shared = SharedNumbers<T, kCount>;

  ThreadedTeam(cpu::ThreadTeam& team, Index rank) : team_(&team), rank_(rank) {}

  [[nodiscard]] Index rank() const { return rank_; }
  [[nodiscard]] Index size() const { return team_->width(); }
  void sync() { team_->sync(); }

  template <class F>
  auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    turn_ ^= 1;
    if (rank_ == 0) put(0, f());
    sync();
    return get<T>(0);
  }
  /// f(k) for k = 0 ... count - 1 in order, each by the next free thread. Item k begins after all up to k - window
  /// have ended, and sees their writes. It begins and ends in a sync.
  template <class F>
  void deal(Offset count, Offset window, F&& f) {
    team_->open_deal(rank_);
    for (Offset k = team_->take(rank_, count, window); k < count; k = team_->take(rank_, count, window)) f(k);
    sync();
  }
  std::uint32_t combine(std::uint32_t bits) {
    return exchange(bits, [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }
  template <class T>
  T max(T value) {
    return exchange(value, [](T a, T b) { return max_(a, b); });
  }
  template <class T>
  T* leaves() {
    return reinterpret_cast<T*>(team_->leaves());
  }

 private:
  template <class T>
  void put(Index rank, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= kTeamValueBytes);
    std::memcpy(team_->slot(turn_, rank), &value, sizeof(T));
  }
  template <class T>
  T get(Index rank) const {
    T value;
    std::memcpy(&value, team_->slot(turn_, rank), sizeof(T));
    return value;
  }
  template <class T, class F>
  T exchange(T value, F&& join) {
    turn_ ^= 1;
    put(rank_, value);
    sync();
    T joined = get<T>(0);
    for (Index rank = 1; rank < size(); ++rank) joined = join(get<T>(rank), joined);
    return joined;
  }

  cpu::ThreadTeam* team_;
  Index rank_;
  int turn_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
