#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stiction::distributed {

/// The seed of "random:SEED", nothing for "bisection". \throws Error(invalid_argument) for anything else.
std::optional<std::uint64_t> partition_seed(const std::string& text);

}  // namespace stiction::distributed
