#pragma once

#include <span>
#include <string>

namespace stiction::gpu_first {

/// Checks that have a share of the time. A phase ends when all phases up to it should have ended, so that it also has
/// their unused time. Checks that have not begun then are left out.
struct Phase {
  const char* name;
  double seconds;
  const char* only;  ///< beginnings of names, in the order in which they run
  const char* skip;  ///< beginnings of names that do not
};

/// The first eight minutes on a GPU, the most telling checks first.
inline constexpr Phase kMinutes[] = {
    {"device", 8, "device", ""},
    {"hashes", 34, "hash/", ""},
    {"times", 84, "robot/", ""},
    {"baseline", 24, "baseline/", ""},
    {"lanes", 16, "lanes/", ""},
    {"checks", 174, "solver/,class/,form/,plan,golden/", ""},
    {"profiles", 60, "ncu/", ""},
    {"graphs", 55, "capture/,repeat/,sanitizer/", "capture/two_grids"},
    {"two grids", 15, "capture/two_grids", ""},
};

/// The plan of that name. \throws Error(invalid_argument) if there is none.
std::span<const Phase> plan_of(const std::string& name);
double seconds_of(std::span<const Phase> plan);

}  // namespace stiction::gpu_first
