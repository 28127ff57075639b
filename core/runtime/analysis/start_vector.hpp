#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stiction {

inline double norm(const std::vector<double>& x) {
  double sum = 0;
  for (const double value : x) sum += value * value;
  return std::sqrt(sum);
}

/// x_i = 2 u_i - 1, u_i the upper 53 bits of splitmix64(i + 1) as a fraction, divided by the vector's length.
inline std::vector<double> start_vector(std::size_t n) {
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) {
    std::uint64_t bits = (static_cast<std::uint64_t>(i) + 1) * 0x9e3779b97f4a7c15ULL;
    bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9ULL;
    bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebULL;
    x[i] = static_cast<double>((bits ^ (bits >> 31)) >> 11) * 0x1p-52 - 1;
  }
  const double length = norm(x);
  for (double& value : x) value /= length;
  return x;
}

}  // namespace stiction
