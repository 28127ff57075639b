#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tools/gpu_first/report.hpp"

namespace stiction::gpu_first {

/// Something that runs in a process of its own.
struct Check {
  std::string name;
  double limit_s;  ///< wall clock, on a GPU
  std::function<void(Report&)> run;
};
using Checks = std::vector<Check>;

// Ordered by importance.
void add_device(Checks& checks);
void add_robot_hashes(Checks& checks);
void add_robot_times(Checks& checks);
void add_baseline(Checks& checks);
void add_lanes(Checks& checks);
void add_plan(Checks& checks);
void add_classes(Checks& checks);
void add_solvers(Checks& checks);
void add_golden(Checks& checks);
void add_forms(Checks& checks);
void add_steps(Checks& checks);
void add_capture(Checks& checks);
void add_repetition(Checks& checks);
void add_times(Checks& checks);
void add_sanitizer(Checks& checks);
void add_profiles(Checks& checks);
// Adds the checks of the program itself.
void add_self(Checks& checks);

}  // namespace stiction::gpu_first
