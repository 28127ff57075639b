#include "cli/memory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>

#if defined(__unix__)
#include <sys/resource.h>
#include <unistd.h>
#endif

#include "stiction/error.hpp"

namespace stiction::cli {

namespace {

/// The number behind a word of a file, or the file's first number for the empty word. Without one: nothing.
std::optional<double> number_in(const char* path, const std::string& word) {
  std::ifstream file(path);
  double value = 0;
  std::string read;
  while (!word.empty() && file >> read && read != word) {
  }
  if (!(file >> value)) return std::nullopt;
  return value;
}

#if defined(__unix__)
std::optional<double> left_of_addresses() {
  rlimit limit{};
  const auto pages = number_in("/proc/self/statm", "");
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY || !pages) return std::nullopt;
  return static_cast<double>(limit.rlim_cur) - *pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}
#else
std::optional<double> left_of_addresses() {
  return std::nullopt;
}
#endif

}  // namespace

std::optional<double> free_memory() {
  auto system = number_in("/proc/meminfo", "MemAvailable:");
  if (system) *system *= 1024;
  // The group's use counts files that the system keeps in memory and gives up at need, so it is not
  // subtracted.
  const auto group = number_in("/sys/fs/cgroup/memory.max", "");
  std::optional<double> least;
  for (const auto& one : {system, group, left_of_addresses()})
    if (one) least = std::max(0.0, std::min(least.value_or(std::numeric_limits<double>::infinity()), *one));
  return least;
}

std::string bytes_text(double bytes) {
  constexpr std::array kUnits{"B", "kB", "MB", "GB", "TB", "PB", "EB"};
  std::size_t unit = 0;
  while (bytes >= 1000 && unit + 1 < kUnits.size()) {
    bytes /= 1000;
    ++unit;
  }
  return fmt::format("{:.3g} {}", bytes, kUnits[unit]);
}

void require_memory(double bytes, const std::string& what) {
  const auto free = free_memory();
  if (free && bytes > *free)
    throw Error(ErrorCode::out_of_memory, fmt::format("{} takes at least {} of memory, and {} are free: choose less",
                                                      what, bytes_text(bytes), bytes_text(*free)));
}

}  // namespace stiction::cli
