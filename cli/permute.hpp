#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction::cli {

/// A pseudo-random order of 0 .. count-1: Fisher-Yates driven by splitmix64(seed), the same on every platform.
std::vector<Offset> random_order(Offset count, std::uint64_t seed);

/// The rows of the environments in `order`, one environment after the other. `env_row_offsets` are file order's.
template <class T>
std::vector<T> gather_rows(std::span<const T> rows, std::span<const Offset> env_row_offsets,
                           std::span<const Offset> order) {
  std::vector<T> gathered;
  gathered.reserve(rows.size());
  for (const Offset env : order) {
    const auto e = static_cast<std::size_t>(env);
    const auto first = rows.begin() + env_row_offsets[e];
    gathered.insert(gathered.end(), first, rows.begin() + env_row_offsets[e + 1]);
  }
  return gathered;
}

/// The inverse of gather_rows.
template <class T>
std::vector<T> scatter_rows(std::span<const T> gathered, std::span<const Offset> env_row_offsets,
                            std::span<const Offset> order) {
  std::vector<T> rows(gathered.size());
  auto next = gathered.begin();
  for (const Offset env : order) {
    const auto e = static_cast<std::size_t>(env);
    const auto length = env_row_offsets[e + 1] - env_row_offsets[e];
    std::copy(next, next + length, rows.begin() + env_row_offsets[e]);
    next += length;
  }
  return rows;
}

}  // namespace stiction::cli
