#pragma once

#include <filesystem>

namespace stiction::fuzz {

/// Writes the arrays and root attributes of an HDF5 file to another one, in the newest layout that HDF5 has: that of
/// h5py's libver="latest". \throws std::runtime_error
void copy_to_latest(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace stiction::fuzz
