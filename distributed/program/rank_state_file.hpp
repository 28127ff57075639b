#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// A file that all ranks write, each its own lines, with the bytes that one process would have written. It has to lie
/// where all ranks see it; of standard output, rank 0's, rank 0 writes the others' lines.
class RankStateFile {
 public:
  /// Rank 0 makes the file. All ranks call it, and the rest. \throws Error(io)
  RankStateFile(Transport& transport, const std::optional<std::filesystem::path>& path, const std::string& header);

  [[nodiscard]] bool is_open() const { return path_.has_value(); }
  /// Appends rank 0's text, then rank 1's, and so on. \throws Error(io), RankLost
  void append(const std::string& text);
  /// \throws Error(io) if something was not written.
  void close();

 private:
  void append_to_standard_output(const std::string& text);
  [[noreturn]] void fail() const;

  Transport& transport_;
  std::optional<std::filesystem::path> path_;
  std::string name_;
  std::fstream file_;
  std::uint64_t length_ = 0;
};

}  // namespace stiction::distributed
