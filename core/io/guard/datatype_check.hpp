#pragma once

#include <span>
#include <string>

namespace stiction::io {

/// Looks through a datatype message (file format specification, IV.A.2.d), which HDF5 1.10.8 decodes without knowing
/// how long it is. Accepted are the types that such files need: integers, floating-point numbers, strings of fixed and
/// of variable length, and enumerators of integers. h5py writes truth values as such enumerators. Returns the defect,
/// or nothing.
std::string datatype_defect(std::span<const char> message);

}  // namespace stiction::io
