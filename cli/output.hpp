#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>

namespace stiction::cli {

/// Makes sure, before any work is done, that a text file can be written at `path`. \throws Error(io) if not.
void require_writable(const std::filesystem::path& path);

/// Makes sure of a file that is written beside its target and renamed over it. The folder must be writable and the
/// target, if there, an ordinary file (renaming over /dev/null would replace it). \throws Error if not.
void require_replaceable(const std::filesystem::path& path);

/// \throws Error(invalid_argument) if `output` is the same file as `input`.
void require_different(const std::filesystem::path& input, const std::filesystem::path& output);

/// An option that names a file to write, and the file if it was given.
struct OutputOption {
  const char* name;
  std::optional<std::filesystem::path> path;
};

/// \throws Error(invalid_argument) if two of them name one file, or both are standard output ("-"). Existing files do
/// not matter.
void require_distinct(std::initializer_list<OutputOption> outputs);

/// Writes `text` to `path`, "-" meaning standard output. \throws Error(io).
void write_text(const std::filesystem::path& path, const std::string& text);

}  // namespace stiction::cli
