#pragma once

#include <pthread.h>

#include <atomic>
#include <cstddef>
#include <cstring>
#include <deque>
#include <type_traits>
#include <vector>

#include "core/team/reduce.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/emulated/emulated_pace.hpp"

namespace stiction::cuda {

/// A barrier whose waiters sleep: with more lanes than cores, waiters that spin would take the turns of those awaited.
class SleepingBarrier {
 public:
  explicit SleepingBarrier(int lanes) { pthread_barrier_init(&barrier_, nullptr, static_cast<unsigned>(lanes)); }
  ~SleepingBarrier() { pthread_barrier_destroy(&barrier_); }
  SleepingBarrier(const SleepingBarrier&) = delete;
  SleepingBarrier& operator=(const SleepingBarrier&) = delete;
  void arrive_and_wait() { pthread_barrier_wait(&barrier_); }

 private:
  pthread_barrier_t barrier_{};
};

/// Memory that the lanes of a host team share.
struct EmulatedTeamMemory {
  explicit EmulatedTeamMemory(int lanes) : width(lanes), barrier(lanes) {
    for (auto& turn : slot) turn.resize(static_cast<std::size_t>(lanes) * kTeamValueBytes);
  }
  int width;
  SleepingBarrier barrier;
  std::vector<std::byte> slot[2];
  alignas(16) std::byte leaves[kReduceLeaves * sizeof(double)] = {};
};

/// Memory that the blocks of a host grid share besides that of each for its own lanes.
struct EmulatedGridMemory {
  EmulatedGridMemory(int blocks, int lanes) : width(blocks * lanes), barrier(width) {
    for (int k = 0; k < blocks; ++k) block.emplace_back(lanes);
    for (auto& turn : slot) turn.resize(static_cast<std::size_t>(blocks) * kTeamValueBytes);
  }
  int width;  ///< lanes of all blocks
  SleepingBarrier barrier;
  std::deque<EmulatedTeamMemory> block;
  std::vector<std::byte> slot[2];
  alignas(16) std::byte leaves[kReduceLeaves * sizeof(double)] = {};
};

/// A team of the emulated device: threads that meet at a barrier and at nothing else. It offers a Team's promises and
/// no more, one barrier an exchange as CudaTeam does. A program with a missing sync hence races here too.
class EmulatedTeam {
 public:
  static constexpr Index kRowTile = 4;

  /// One block, whose lanes run at different speeds by `seed`.
  EmulatedTeam(EmulatedTeamMemory& memory, int rank, std::uint64_t seed = 0)
      : memory_(&memory), lane_(rank), pace_(seed, static_cast<std::uint64_t>(rank)) {}
  /// The whole grid.
  EmulatedTeam(EmulatedGridMemory& grid, int rank, std::uint64_t seed)
      : grid_(&grid), pace_(seed, static_cast<std::uint64_t>(rank)) {
    const int lanes = grid.block.front().width;
    block_ = rank / lanes;
    lane_ = rank % lanes;
    memory_ = &grid.block[static_cast<std::size_t>(block_)];
  }

  [[nodiscard]] Index rank() const { return block_ * memory_->width + lane_; }
  [[nodiscard]] Index size() const { return grid_ == nullptr ? memory_->width : grid_->width; }
  void sync() {
    if (size() > 1) meet_at(grid_ == nullptr ? memory_->barrier : grid_->barrier);
  }

  template <class F>
  auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    if (size() == 1) return T(f());
    turn_ ^= 1;
    std::byte* const slot = grid_ == nullptr ? memory_->slot[turn_].data() : grid_->slot[turn_].data();
    if (rank() == 0) put(slot, 0, T(f()));
    sync();
    return get<T>(slot, 0);
  }

  std::uint32_t combine(std::uint32_t bits) {
    return exchange(bits, [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }

  /// The sum of integers over the lanes.
  Index total(Index value) {
    return exchange(value, [](Index a, Index b) { return a + b; });
  }

  template <class T>
  T max(T value) {
    return exchange(value, [](T a, T b) { return max_(a, b); });
  }

  template <class T>
  T* leaves() {
    return reinterpret_cast<T*>(grid_ == nullptr ? memory_->leaves : grid_->leaves);
  }

  Offset fetch(Offset* counter, Offset count = 1) {
    return broadcast([&] { return std::atomic_ref(*counter).fetch_add(count); });
  }

 private:
  void meet_at(SleepingBarrier& barrier) {
    pace_.step();
    barrier.arrive_and_wait();
    pace_.step();
  }

  template <class T>
  static void put(std::byte* slot, int lane, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= kTeamValueBytes);
    std::memcpy(slot + static_cast<std::size_t>(lane) * kTeamValueBytes, &value, sizeof(T));
  }
  template <class T>
  static T get(const std::byte* slot, int lane) {
    T value;
    std::memcpy(&value, slot + static_cast<std::size_t>(lane) * kTeamValueBytes, sizeof(T));
    return value;
  }

  /// Joins the values of `count` members once all are in the slot, including `own`. Each member's order begins with
  /// its own value, so that an operation whose order shows would differ.
  template <class T, class F>
  static T join_slot(const std::byte* slot, int count, int own, T value, const F& join) {
    for (int step = 1; step < count; ++step) value = join(get<T>(slot, (own + step) % count), value);
    return value;
  }

  /// Every lane's value joined, in a grid first within each block, as a warp does before the grid meets.
  template <class T, class F>
  T exchange(T value, const F& join) {
    if (size() == 1) return value;
    turn_ ^= 1;
    if (memory_->width > 1) {
      std::byte* const slot = memory_->slot[turn_].data();
      put(slot, lane_, value);
      meet_at(memory_->barrier);
      value = join_slot(slot, memory_->width, lane_, value, join);
    }
    if (grid_ == nullptr) return value;
    std::byte* const slot = grid_->slot[turn_].data();
    if (lane_ == 0) put(slot, block_, value);
    sync();
    return join_slot(slot, static_cast<int>(grid_->block.size()), block_, value, join);
  }

  EmulatedTeamMemory* memory_ = nullptr;  ///< of this lane's block
  EmulatedGridMemory* grid_ = nullptr;    ///< null: the block is the team
  int block_ = 0;
  int lane_ = 0;
  int turn_ = 0;
  Pace pace_;
};

}  // namespace stiction::cuda
