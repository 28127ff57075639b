#include "cli/thread_use.hpp"

#include <fmt/format.h>

namespace stiction::cli {

Json json_of(const ThreadUse& use) {
  if (use.available <= 0) return nullptr;
  return {{"seconds", use.seconds},
          {"busy", use.busy},
          {"synchronisation_share", use.synchronisation_share()},
          {"imbalance", use.imbalance()}};
}

std::string thread_use_text(const ThreadUse& use) {
  if (use.available <= 0) return "-";
  return fmt::format("{:.1f} % waiting, imbalance {:.3f}", 100 * use.synchronisation_share(), use.imbalance());
}

}  // namespace stiction::cli
