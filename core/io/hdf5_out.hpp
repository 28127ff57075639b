#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/io/guard/hdf5_session.hpp"
#include "stiction/types.hpp"

namespace stiction::io {

/// Refuses an array that is neither empty nor of the expected length. \throws Error, which begins with `what`.
void require_length(const std::string& what, std::size_t found, std::size_t expected);

/// An HDF5 file being written. HDF5 writes it into memory, and commit() to a file beside its destination, to which that
/// is renamed. A reader hence never sees half a file, and a failed write leaves the old one. HDF5 1.10 must not meet a
/// full disk itself: it cannot close the file then, and crashes when the program ends. The same calls give the same
/// bytes (no time stamps).
class OutputFile {
 public:
  explicit OutputFile(std::filesystem::path path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void group(const std::string& path);
  void array(const std::string& path, std::span<const double> values);
  void array(const std::string& path, std::span<const float> values);
  void array(const std::string& path, std::span<const std::int64_t> values);
  void array(const std::string& path, std::span<const std::int32_t> values);
  void array(const std::string& path, std::span<const std::uint64_t> values);
  void array(const std::string& path, std::span<const std::uint32_t> values);
  void array(const std::string& path, std::span<const std::uint8_t> values);
  /// Numbers that are of that precision, narrowed to it.
  void reals(const std::string& path, const std::vector<double>& values, Precision precision);
  /// Variable-length UTF-8 strings.
  void strings(const std::string& path, const std::vector<std::string>& values);
  /// One fixed-length string as a scalar dataset.
  void text(const std::string& path, const std::string& value);
  /// Attributes of the root.
  void attribute(const std::string& name, const std::string& value);
  void attribute(const std::string& name, std::int64_t value);

  /// Completes the file and moves it to its destination.
  void commit();
  /// Likewise, and returns when both file and name are on the disk: a machine that stops then still has it.
  void commit_to_disk();

 private:
  void write(const std::string& path, hid_t file_type, hid_t memory_type, std::size_t width, std::size_t count,
             const void* values);
  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail_on_disk(const std::string& what) const;
  void write_to_disk();
  void put_in_place();

  Session session_;
  std::filesystem::path path_;
  std::filesystem::path temporary_;
  int disk_ = -1;  ///< descriptor of temporary_
  bool committed_ = false;
  Handle file_;
};

/// Renames a complete file, when it is on the disk, and returns when the name is there, too. \throws Error(io)
void put_on_disk(const std::filesystem::path& written, const std::filesystem::path& path);

}  // namespace stiction::io
