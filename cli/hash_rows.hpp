#pragma once

#include <cstdint>
#include <span>

#include "stiction/solver.hpp"

namespace stiction::cli {

/// Hash of a solution file's own bits: an f32 file's values were widened exactly and narrow back exactly.
std::uint64_t hash_rows(std::span<const double> rows, Precision precision);

}  // namespace stiction::cli
