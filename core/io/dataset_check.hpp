#pragma once

#include <cstddef>

#include "core/io/hdf5_session.hpp"

namespace stiction::io {

/// Longest text attribute or fixed-length string taken.
constexpr std::size_t kMaxTextBytes = std::size_t{1} << 20;

/// The standard types: IEEE and two's complement, either byte order. HDF5 can describe others (odd exponents, padding
/// bits), which real writers do not produce and HDF5 converts with rarely used code.
bool is_standard(hid_t type, H5T_class_t type_class);

}  // namespace stiction::io
