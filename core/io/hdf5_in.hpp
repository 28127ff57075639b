#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "core/io/guard/dataset_check.hpp"
#include "core/io/guard/hdf5_session.hpp"
#include "core/io/guard/text_heap.hpp"

namespace stiction::io {

/// An HDF5 file that is not trusted. Only flat arrays of plain numbers and strings are read from it, in the file
/// itself (no links to elsewhere, no external storage). They go through no filter but deflate, shuffle and fletcher32.
/// Nothing is allocated before the size that the file claims was compared with the size that the file has. Every
/// failure is an Error(bad_file) that begins with the file's name and names the dataset.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path);
  /// Reads the bytes of a file in memory; `name` stands for it in messages.
  InputFile(std::span<const std::byte> image, std::string name);

  /// Returns true if there is a group or dataset of that path. A link to elsewhere is refused.
  [[nodiscard]] bool has(const std::string& path) const;

  /// A 1-d dataset of f32 or f64, widened exactly. If `length` is given, the array has that length.
  [[nodiscard]] std::vector<double> reals(const std::string& path, std::optional<std::size_t> length = {}) const;
  /// Returns true if a dataset's numbers are f32.
  [[nodiscard]] bool is_single(const std::string& path) const;
  /// A 1-d dataset of integers of any width, every one of which fits T.
  template <class T>
  [[nodiscard]] std::vector<T> integers(const std::string& path, std::optional<std::size_t> length = {}) const;
  /// Reads a 1-d dataset of integers of any width as 64 bits each. Numbers of unsigned types may have the top bit set.
  /// Numbers of signed types are negative then and refused.
  [[nodiscard]] std::vector<std::uint64_t> bits(const std::string& path, std::optional<std::size_t> length = {}) const;
  /// A dataset of one integer.
  [[nodiscard]] std::int64_t integer(const std::string& path) const;
  /// A 1-d dataset of strings, of fixed or variable length.
  [[nodiscard]] std::vector<std::string> strings(const std::string& path, std::optional<std::size_t> length = {}) const;

  /// A scalar attribute of the root; nothing if absent.
  [[nodiscard]] std::optional<std::string> text_attribute(const std::string& name) const;
  [[nodiscard]] std::optional<std::int64_t> integer_attribute(const std::string& name) const;

  /// The file's name without folders.
  [[nodiscard]] std::string name() const { return std::filesystem::path(name_).filename().string(); }

  /// Throws Error(bad_file) "FILE: sentence".
  [[noreturn]] void refuse(const std::string& sentence) const;
  [[noreturn]] void refuse_dataset(const std::string& path, const std::string& what) const;

 private:
  struct Dataset {
    Handle id;
    Handle type;
    std::size_t count = 0;
  };
  [[nodiscard]] Dataset open(const std::string& path, Values values, std::optional<std::size_t> length) const;
  void read(const std::string& path, const Dataset& dataset, hid_t memory_type, void* out) const;
  [[nodiscard]] bool is_unsigned_64(const Dataset& dataset) const;
  [[nodiscard]] std::vector<std::int64_t> wide_integers(const std::string& path,
                                                        std::optional<std::size_t> length) const;
  [[nodiscard]] TextHeap text_heap() const;
  void read_geometry();
  void check_superblock() const;
  void check_header(const std::string& path, const std::string& what) const;

  Session session_;
  std::string name_;
  std::uint64_t file_bytes_ = 0;
  std::uint64_t base_ = 0;  ///< where addresses in the file count from
  mutable RawBytes bytes_;
  Handle file_;
};

template <class T>
std::vector<T> InputFile::integers(const std::string& path, std::optional<std::size_t> length) const {
  std::vector<std::int64_t> wide = wide_integers(path, length);
  if constexpr (std::is_same_v<T, std::int64_t>) {
    return wide;
  } else {
    std::vector<T> narrow(wide.size());
    for (std::size_t i = 0; i < wide.size(); ++i) {
      if (wide[i] < std::int64_t{std::numeric_limits<T>::min()} ||
          wide[i] > std::int64_t{std::numeric_limits<T>::max()}) {
        refuse_dataset(path, "holds " + std::to_string(wide[i]) + " at position " + std::to_string(i) +
                                 ", which does not fit " + std::to_string(8 * sizeof(T)) + " bits");
      }
      narrow[i] = static_cast<T>(wide[i]);
    }
    return narrow;
  }
}

}  // namespace stiction::io
