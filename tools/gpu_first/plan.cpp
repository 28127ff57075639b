#include "tools/gpu_first/plan.hpp"

#include "stiction/error.hpp"

namespace stiction::gpu_first {

std::span<const Phase> plan_of(const std::string& name) {
  if (name != "minutes") throw Error(ErrorCode::invalid_argument, "--plan is '" + name + "': use minutes");
  return kMinutes;
}

constexpr double kMostSeconds = 470;  ///< of a command of ten minutes, start and end of the machine included
static_assert([] {
  double sum = 0;
  for (const Phase& phase : kMinutes) sum += phase.seconds;
  return sum;
}() <= kMostSeconds);

double seconds_of(std::span<const Phase> plan) {
  double sum = 0;
  for (const Phase& phase : plan) sum += phase.seconds;
  return sum;
}

}  // namespace stiction::gpu_first
