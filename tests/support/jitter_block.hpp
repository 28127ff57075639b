#pragma once

#include <chrono>
#include <cstdint>
#include <thread>
#include <utility>

#include "core/block/block.hpp"

namespace stiction::test {

/// Any Block whose lanes disagree about speed: before and after each phase a lane goes on at once, yields or sleeps, as
/// its own pseudo-random sequence says.
template <Block Inner>
class JitterBlock {
 public:
  static constexpr Index kRowTile = Inner::kRowTile;

  JitterBlock(Inner inner, std::uint64_t seed)
      : inner_(std::move(inner)), state_(seed * 0x9e3779b97f4a7c15U + static_cast<std::uint64_t>(inner_.rank()) + 1U) {}

  [[nodiscard]] Index rank() const { return inner_.rank(); }
  [[nodiscard]] Index size() const { return inner_.size(); }
  void sync() {
    dawdle();
    inner_.sync();
    dawdle();
  }
  template <class F>
  auto broadcast(F&& f) {
    dawdle();
    const auto value = inner_.broadcast(std::forward<F>(f));
    dawdle();
    return value;
  }
  std::uint32_t combine(std::uint32_t bits) {
    dawdle();
    return inner_.combine(bits);
  }
  template <class T>
  T max(T value) {
    dawdle();
    return inner_.max(value);
  }
  template <class T>
  T* leaves() {
    return inner_.template leaves<T>();
  }

 private:
  void dawdle() {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    if (state_ % 64 == 0) {
      std::this_thread::sleep_for(std::chrono::microseconds(1 + (state_ >> 32) % 50));
    } else if (state_ % 4 == 0) {
      std::this_thread::yield();
    }
  }

  Inner inner_;
  std::uint64_t state_;
};

}  // namespace stiction::test
