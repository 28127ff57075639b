#pragma once

#include <cstdint>
#include <string>

#include "core/io/guard/raw_bytes.hpp"

namespace stiction::io {

/// Searches the messages of an HDF5 object header (file format specification, IV.A) for data that HDF5 1.10.8 takes on
/// trust:
/// * messages that end before their contents (message_check.hpp);
/// * types that are neither numbers nor strings (datatype_check.hpp);
/// * chunk sizes of zero or of another rank or element than the array, by which it divides;
/// * a group's heap of names of absurd size.
///
/// All else about a header is left to HDF5, which checks it. `base`: where addresses count from; `address`: of the
/// header. Returns the defect, or nothing.
std::string header_defect(RawBytes& bytes, std::uint64_t file_bytes, std::uint64_t base, std::uint64_t address);

/// Checks the data that HDF5 would decode already when it opens the file. These are the root's header, and an
/// extension of the superblock, which honest files of this kind do not have. A file without a superblock is left to
/// HDF5. Returns the defect, or nothing.
std::string superblock_defect(RawBytes& bytes, std::uint64_t file_bytes);

}  // namespace stiction::io
