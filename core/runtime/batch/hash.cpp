#include "stiction/hash.hpp"

#include <bit>

namespace stiction {
namespace {

/// 2^64 / golden ratio: the increment of splitmix64, which makes equal values at different places hash apart.
constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ULL;

/// The finaliser of splitmix64 (Steele, Lea, Flood 2014, variant 13 of Stafford's mixers): a bijection of 64 bits.
constexpr std::uint64_t splitmix64(std::uint64_t z) {
  z += kGolden;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

/// The bits of a value. IEEE 754 leaves sign and payload of a NaN to the machine (x86 and NVIDIA GPUs differ). Every
/// NaN hence counts as the same one. Tested on the bits: no compiler option can fold that away.
constexpr std::uint64_t canonical_bits(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  return (bits & 0x7fffffffU) > 0x7f800000U ? 0x7fc00000U : bits;
}

constexpr std::uint64_t canonical_bits(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  return (bits & 0x7fffffffffffffffULL) > 0x7ff0000000000000ULL ? 0x7ff8000000000000ULL : bits;
}

template <class Real>
std::uint64_t hash_of(std::span<const Real> values, std::uint64_t first = 0) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    sum += splitmix64(canonical_bits(values[i]) ^ (kGolden * (first + static_cast<std::uint64_t>(i) + 1)));
  }
  return sum;
}

}  // namespace

std::uint64_t hash_bits(std::span<const float> values) noexcept {
  return hash_of(values);
}
std::uint64_t hash_bits(std::span<const double> values) noexcept {
  return hash_of(values);
}
std::uint64_t hash_part(std::span<const float> values, std::uint64_t first) noexcept {
  return hash_of(values, first);
}
std::uint64_t hash_part(std::span<const double> values, std::uint64_t first) noexcept {
  return hash_of(values, first);
}

}  // namespace stiction
