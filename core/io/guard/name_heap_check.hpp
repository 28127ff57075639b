#pragma once

#include <cstdint>
#include <string>

#include "core/io/guard/raw_bytes.hpp"

namespace stiction::io {

/// Looks through the heap that holds the names of a group's members (file format specification, III.D). HDF5 1.10.8
/// adds to the size that it claims before it allocates memory, and wraps around. It also follows the list of free
/// places without end where that runs in a circle. `base`: where addresses count from; `address`: of the heap. Returns
/// the defect, or nothing.
std::string name_heap_defect(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base, std::uint64_t address);

}  // namespace stiction::io
