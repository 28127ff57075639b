#pragma once

#include <cstdint>
#include <string>

#include "core/io/raw_bytes.hpp"

namespace stiction::io {

/// Looks through the messages of an HDF5 object header (file format specification, IV.A) for what HDF5 1.10.8 takes on
/// trust: chunk sizes of zero or of another rank than the shape make it divide by zero, an attribute whose value is
/// larger than its message makes it read past the end, and so does a group's heap of names of absurd size. Everything
/// else about a header is left to HDF5, which checks it.
/// `base`: where addresses count from; `address`: of the header.
/// Returns what is wrong, or nothing.
std::string header_defect(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base, std::uint64_t address);

}  // namespace stiction::io
