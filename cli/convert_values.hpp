#pragma once

#include <vector>

namespace stiction::cli {

/// The numbers in another precision.
template <class To, class From>
std::vector<To> convert_values(const std::vector<From>& values) {
  std::vector<To> converted;
  converted.reserve(values.size());
  for (const From value : values) converted.push_back(static_cast<To>(value));
  return converted;
}

}  // namespace stiction::cli
