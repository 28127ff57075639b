#include "stiction/captured_calls.hpp"

#include "core/machine/count_captured_call.hpp"

namespace stiction {
namespace {

thread_local std::uint64_t captured = 0;

}  // namespace

std::uint64_t captured_calls() noexcept {
  return captured;
}

void count_captured_call() noexcept {
  ++captured;
}

}  // namespace stiction
