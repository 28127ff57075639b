#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// Part of an array that one rank has: `count` blocks of `block` numbers, `stride` apart, from `start` on.
struct Slab {
  std::uint64_t total, start, stride, count, block;
};

/// An HDF5 file that all ranks write together, each its own numbers of every array. All ranks call the same functions,
/// with the same names and totals. It lies beside its destination until commit(), and is removed where that is not
/// reached. A rank that throws has to end the job: the others wait for it, and know no deadline.
class SharedFile {
 public:
  virtual ~SharedFile() = default;
  /// Attributes of the root, the same on all ranks.
  virtual void attribute(const std::string& name, const std::string& value) = 0;
  virtual void attribute(const std::string& name, std::int64_t value) = 0;
  virtual void array(const std::string& name, std::span<const double> own, const Slab& slab) = 0;
  virtual void array(const std::string& name, std::span<const float> own, const Slab& slab) = 0;
  virtual void array(const std::string& name, std::span<const std::int64_t> own, const Slab& slab) = 0;
  virtual void array(const std::string& name, std::span<const std::uint64_t> own, const Slab& slab) = 0;
  /// Completes the file. Rank 0 makes it the checkpoint at its destination. \throws Error(io)
  virtual void commit() = 0;
};

/// Returns true if this program was built with parallel HDF5.
bool has_shared_files();
/// A file for arrays of so many bytes together. They are taken from the disk at once. A disk that is too small is
/// hence found here, before HDF5 meets it. \throws Error(io), Error(unsupported) without has_shared_files()
std::unique_ptr<SharedFile> make_shared_file(Transport& transport, const std::filesystem::path& path,
                                             std::uint64_t bytes);

}  // namespace stiction::distributed
