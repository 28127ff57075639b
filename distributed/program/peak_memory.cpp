#include "distributed/program/peak_memory.hpp"

#include <fstream>
#include <string>

namespace stiction::distributed {

std::int64_t peak_memory() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    if (word != "VmHWM:") continue;
    std::int64_t kibibytes = 0;
    status >> kibibytes;
    return 1024 * kibibytes;
  }
  return 0;
}

}  // namespace stiction::distributed
