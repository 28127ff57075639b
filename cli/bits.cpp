#include "cli/bits.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstdint>

namespace stiction::cli {

namespace {

/// Maps bits to unsigned integers in the order of the numbers, -0 just below +0.
template <class Bits>
Bits ordered(Bits bits) {
  constexpr Bits kSign = Bits{1} << (sizeof(Bits) * 8 - 1);
  return (bits & kSign) != 0 ? static_cast<Bits>(~bits) : static_cast<Bits>(bits | kSign);
}

template <class Bits, class Real>
std::uint64_t distance(Real a, Real b) {
  const Bits x = ordered(std::bit_cast<Bits>(a));
  const Bits y = ordered(std::bit_cast<Bits>(b));
  return x > y ? x - y : y - x;
}

}  // namespace

bool same_bits(double a, double b) {
  if (std::isnan(a) && std::isnan(b)) return true;
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

std::string ulps_text(double a, double b, Precision precision) {
  if (std::isnan(a) || std::isnan(b)) return "NaN against a number";
  const std::uint64_t apart = precision == Precision::f32
                                  ? distance<std::uint32_t>(static_cast<float>(a), static_cast<float>(b))
                                  : distance<std::uint64_t>(a, b);
  return fmt::format("{} ulp{}", apart, apart == 1 ? "" : "s");
}

}  // namespace stiction::cli
