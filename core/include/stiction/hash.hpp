#pragma once

/// \file
/// Hashes of the bits of an answer.

#include <cstdint>
#include <span>

namespace stiction {

/// Hash of the bits of an array: the sum over elements of splitmix64(bits ^ golden * (i + 1)), mod 2^64.
/// A sum, so that any machine may add in any order; position matters, -0 and +0 differ, every NaN hashes alike.
std::uint64_t hash_bits(std::span<const float> values) noexcept;
/// Hash of the bits of an array of doubles.
std::uint64_t hash_bits(std::span<const double> values) noexcept;
/// Share of elements `first` on of a longer array in its hash. The sum over all parts of an array is its hash.
std::uint64_t hash_part(std::span<const float> values, std::uint64_t first) noexcept;
/// Likewise of an array of doubles.
std::uint64_t hash_part(std::span<const double> values, std::uint64_t first) noexcept;

}  // namespace stiction
