#pragma once

#include <chrono>
#include <cstdint>
#include <thread>

namespace stiction::cuda {

/// Lets a lane go on at once, yield or sleep, by its pseudo-random sequence. Lanes that nothing but a barrier holds
/// together hence come apart.
class Pace {
 public:
  /// Never dawdles.
  Pace() = default;
  /// Nor with seed 0.
  Pace(std::uint64_t seed, std::uint64_t lane) : state_(seed == 0 ? 0 : seed * 0x9e3779b97f4a7c15U + lane + 1U) {}

  void step() {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 7;
    state_ ^= state_ << 17;
    if (state_ == 0) return;
    if (state_ % 64 == 0) {
      std::this_thread::sleep_for(std::chrono::microseconds(1 + (state_ >> 32) % 50));
    } else if (state_ % 4 == 0) {
      std::this_thread::yield();
    }
  }

 private:
  std::uint64_t state_ = 0;
};

}  // namespace stiction::cuda
