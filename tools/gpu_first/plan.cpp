#include "tools/gpu_first/plan.hpp"

#include "stiction/error.hpp"

namespace stiction::gpu_first {

std::span<const Phase> plan_of(const std::string& name) {
  if (name != "minutes") throw Error(ErrorCode::invalid_argument, "--plan is '" + name + "': use minutes");
  return kMinutes;
}

double seconds_of(std::span<const Phase> plan) {
  double sum = 0;
  for (const Phase& phase : plan) sum += phase.seconds;
  return sum;
}

}  // namespace stiction::gpu_first
