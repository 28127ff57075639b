#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <type_traits>
#include <vector>

namespace stiction::cli {

template <class T>
struct Quantiles {
  T min, median, p90, max;
};

/// Nearest-rank quantiles: the p-th percentile of n values is the ceil(p n / 100)-th smallest, so every number
/// reported is one that occurred. NaN counts as larger than everything: a broken environment cannot hide.
/// Empty for no values.
template <class T>
std::optional<Quantiles<T>> quantiles(std::vector<T> values) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end(), [](T a, T b) {
    if constexpr (std::is_floating_point_v<T>) {
      if (std::isnan(a)) return false;
      if (std::isnan(b)) return true;
    }
    return a < b;
  });
  const auto rank = [&](std::size_t percent) { return values[(percent * values.size() + 99) / 100 - 1]; };
  return Quantiles<T>{values.front(), rank(50), rank(90), values.back()};
}

}  // namespace stiction::cli
