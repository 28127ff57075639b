#include "cli/output.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <system_error>

#include "stiction/error.hpp"

namespace stiction::cli {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void refuse(const fs::path& path, const std::string& why) {
  throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", path.string(), why));
}

void probe(const fs::path& target, const fs::path& probed) {
  std::error_code ignored;
  const bool there = fs::exists(probed, ignored);
  errno = 0;
  std::FILE* file = std::fopen(probed.c_str(), "ab");
  if (file == nullptr) refuse(target, std::strerror(errno));
  std::fclose(file);
  if (!there) fs::remove(probed, ignored);
}

/// Devices such as /dev/null take any number of outputs.
bool is_one_file(const fs::path& a, const fs::path& b) {
  std::error_code ignored;
  if (a == "-" || b == "-") return a == b;
  if (fs::exists(a, ignored) && !fs::is_regular_file(a, ignored)) return false;
  const auto place = [&](const fs::path& path) { return fs::weakly_canonical(fs::absolute(path, ignored), ignored); };
  return fs::equivalent(a, b, ignored) || place(a) == place(b);
}

}  // namespace

void require_writable(const fs::path& path) {
  if (path == "-") return;
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) refuse(path, "it is a folder");
  probe(path, path);
}

void require_replaceable(const fs::path& path) {
  if (path.empty()) throw Error(ErrorCode::invalid_argument, "the name of a file to write is empty; name one");
  if (path == "-") refuse("standard output", "a file of HDF5 needs a name");
  std::error_code trouble;
  const fs::file_status status = fs::status(path, trouble);
  if (fs::exists(status)) {
    if (!fs::is_regular_file(status)) refuse(path, "it exists and is not an ordinary file");
    probe(path, path);
  } else if (status.type() != fs::file_type::not_found) {
    refuse(path, trouble.message());  // a circle of links, for instance
  }
  fs::path beside = path;
  beside += fmt::format(".probe-{}", getpid());
  probe(path, beside);
}

void require_different(const fs::path& input, const fs::path& output) {
  std::error_code ignored;
  if (fs::equivalent(input, output, ignored)) {
    throw Error(ErrorCode::invalid_argument,
                fmt::format("{}: the output would overwrite the input; choose another output", output.string()));
  }
}

void require_distinct(std::initializer_list<OutputOption> outputs) {
  for (const OutputOption* one = outputs.begin(); one != outputs.end(); ++one) {
    for (const OutputOption* other = outputs.begin(); other != one; ++other) {
      if (!one->path || !other->path || !is_one_file(*other->path, *one->path)) continue;
      const std::string file = *one->path == "-" ? "standard output" : one->path->string();
      throw Error(
          ErrorCode::invalid_argument,
          fmt::format("{}: both {} and {} would be written there; choose another file", file, other->name, one->name));
    }
  }
}

void write_text(const fs::path& path, const std::string& text) {
  if (path == "-") {
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size())
      refuse("standard output", std::strerror(errno));
    return;
  }
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) refuse(path, std::strerror(errno));
  const bool complete = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  const int write_error = errno;
  const bool closed = std::fclose(file) == 0;
  if (!complete || !closed) refuse(path, std::strerror(complete ? errno : write_error));
}

}  // namespace stiction::cli
