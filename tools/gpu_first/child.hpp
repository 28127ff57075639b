#pragma once

#include <functional>
#include <string>
#include <vector>

namespace stiction::gpu_first {

/// End of a process.
struct Ending {
  enum class Kind { exited, signalled, out_of_time } kind = Kind::exited;
  int number = 0;       ///< exit status, or signal
  double seconds = 0;   ///< wall clock
  std::string printed;  ///< end of its output on either stream
};

/// Runs a program, and kills it once `limit_s` are over. Calls `hear` with each line that it prints, at once.
/// \throws Error(io) if it cannot be started.
Ending run_child(const std::vector<std::string>& command, double limit_s,
                 const std::function<void(const std::string&)>& hear = {});

}  // namespace stiction::gpu_first
