#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace stiction::io {

/// Computes how many bytes a zlib stream (RFC 1950, RFC 1951) unpacks to, from its codes without unpacking it. Returns
/// nothing if it is damaged or more than `limit`. Checksums and distances are left to zlib, which refuses wrong ones.
std::optional<std::uint64_t> inflated_size(std::span<const char> stream, std::uint64_t limit);

}  // namespace stiction::io
