#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "cli/quantiles.hpp"

namespace stiction::cli {

/// Keys in the order they are written.
using Json = nlohmann::ordered_json;

/// {"min", "median", "p90", "max"}, each null when there are no values (and when not finite, as JSON wants it).
template <class T>
Json json_of(const std::optional<Quantiles<T>>& values) {
  if (!values) return {{"min", nullptr}, {"median", nullptr}, {"p90", nullptr}, {"max", nullptr}};
  return {{"min", values->min}, {"median", values->median}, {"p90", values->p90}, {"max", values->max}};
}

/// Indented, closed by a line feed; bytes that are not UTF-8 (file names) are replaced, not refused.
inline std::string dump(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace stiction::cli
