#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/io/guard/hdf5_session.hpp"

namespace stiction::io {

/// Longest text attribute or fixed-length string taken.
constexpr std::size_t kMaxTextBytes = std::size_t{1} << 20;

/// The standard types: IEEE and two's complement, either byte order. HDF5 can describe others (odd exponents, padding
/// bits), which real writers do not produce and HDF5 converts with rarely used code.
bool is_standard(hid_t type, H5T_class_t type_class);

/// Values that a reader expects in a dataset.
enum class Values { real, integer, text };

/// Names the defect in the type of a dataset that is to hold such values, or nothing.
std::string type_defect(hid_t type, Values values);

/// A dataset of one dimension, open, with its claims.
struct Claim {
  hid_t dataset;
  hid_t type;
  std::size_t count;
};

/// Names the defect in the claim, by the bytes that a file of so many stores for the dataset, or nothing.
std::string storage_defect(const Claim& claim, std::uint64_t file_bytes);

}  // namespace stiction::io
