#pragma once

#include <cmath>
#include <cstdio>
#include <cstring>
#include <span>

namespace stiction::fuzz {

/// Ends the program with a sentence where a promise does not hold.
inline void require(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", promise);
  __builtin_trap();
}

template <class T>
bool same_bits(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0);
}

template <class Real>
bool all_finite(std::span<const Real> values) {
  for (const Real value : values) {
    if (!std::isfinite(value)) return false;
  }
  return true;
}

}  // namespace stiction::fuzz
