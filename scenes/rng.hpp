#pragma once

#include <cstdint>

namespace stiction::scenes {

/// splitmix64's output function: a bijection of 64-bit words (Steele, Lea, Flood 2014).
inline std::uint64_t mix_bits(std::uint64_t z) noexcept {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

/// splitmix64. Ours because the distributions of <random> differ between standard libraries. Draw at most once per
/// expression: compilers differ in the order in which they evaluate arguments and operands (braced lists have one).
class Rng {
 public:
  explicit Rng(std::uint64_t key) noexcept : state_(key) {}

  std::uint64_t next() noexcept { return mix_bits(state_ += 0x9e3779b97f4a7c15ULL); }

  /// As if so many numbers had been drawn.
  void skip(std::uint64_t count) noexcept { state_ += 0x9e3779b97f4a7c15ULL * count; }

  /// Uniform in [0, 1), a multiple of 2^-53: exact on every machine.
  double uniform() noexcept { return static_cast<double>(next() >> 11) * 0x1p-53; }
  double uniform(double lo, double hi) noexcept { return lo + (hi - lo) * uniform(); }
  /// Uniform in (-half, half).
  double symmetric(double half) noexcept { return uniform(-half, half); }

  /// Uniform in 0 .. count-1; count >= 1.
  int below(int count) noexcept { return static_cast<int>(((next() >> 32) * static_cast<std::uint64_t>(count)) >> 32); }
  bool chance(double probability) noexcept { return uniform() < probability; }

 private:
  std::uint64_t state_;
};

}  // namespace stiction::scenes
