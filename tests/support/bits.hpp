#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <iomanip>
#include <span>
#include <sstream>
#include <string>
#include <type_traits>

#include <gtest/gtest.h>

#include "stiction/solver.hpp"

namespace stiction::test {

/// A number as its bits.
template <class Real>
std::string hex_bits(Real value) {
  using Bits = std::conditional_t<sizeof(Real) == 4, std::uint32_t, std::uint64_t>;
  std::ostringstream text;
  text << "0x" << std::hex << std::setfill('0') << std::setw(2 * sizeof(Real)) << std::bit_cast<Bits>(value) << " ("
       << std::setprecision(9) << value << ")";
  return text.str();
}

/// Success if both hold the same bits; else the first index at which they differ, with both values.
template <class Real>
::testing::AssertionResult same_bits(std::span<const Real> expected, std::span<const Real> actual) {
  if (expected.size() != actual.size())
    return ::testing::AssertionFailure() << expected.size() << " numbers expected, " << actual.size() << " are there";
  for (std::size_t i = 0; i < expected.size(); ++i)
    if (std::memcmp(&expected[i], &actual[i], sizeof(Real)) != 0)
      return ::testing::AssertionFailure() << "first difference at " << i << " of " << expected.size() << ": expected "
                                           << hex_bits(expected[i]) << ", is " << hex_bits(actual[i]);
  return ::testing::AssertionSuccess();
}

/// Compares status records, field by field in the message.
inline ::testing::AssertionResult same_bits(std::span<const EnvStatus> expected, std::span<const EnvStatus> actual) {
  if (expected.size() != actual.size())
    return ::testing::AssertionFailure() << expected.size() << " records expected, " << actual.size() << " are there";
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const EnvStatus& e = expected[i];
    const EnvStatus& a = actual[i];
    if (std::memcmp(&e, &a, sizeof(EnvStatus)) != 0)
      return ::testing::AssertionFailure()
             << "environment " << i << ": expected " << to_string(e.code) << " after " << e.iterations << ", flags "
             << e.flags << ", residual " << hex_bits(e.residual) << ", " << hex_bits(e.residual_absolute)
             << ", islands " << e.islands << "; is " << to_string(a.code) << " after " << a.iterations << ", flags "
             << a.flags << ", residual " << hex_bits(a.residual) << ", " << hex_bits(a.residual_absolute)
             << ", islands " << a.islands;
  }
  return ::testing::AssertionSuccess();
}

/// Everything a solution holds.
template <class Real>
::testing::AssertionResult same_bits(const Solution<Real>& expected, const Solution<Real>& actual) {
  const auto status = same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(actual.status));
  if (!status) return status;
  const auto lambda = same_bits(std::span<const Real>(expected.lambda), std::span<const Real>(actual.lambda));
  if (!lambda) return ::testing::AssertionFailure() << "lambda: " << lambda.message();
  const auto w = same_bits(std::span<const Real>(expected.w), std::span<const Real>(actual.w));
  if (!w) return ::testing::AssertionFailure() << "w: " << w.message();
  return ::testing::AssertionSuccess();
}

}  // namespace stiction::test
