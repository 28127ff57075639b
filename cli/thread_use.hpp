#pragma once

#include <string>

#include "cli/json_text.hpp"
#include "stiction/thread_meter.hpp"

namespace stiction::cli {

/// {"seconds", "busy", "synchronisation_share", "imbalance"} (docs/howto/threads.md), null where nothing was shared
/// out.
Json json_of(const ThreadUse& use);
/// "2.1 % waiting, imbalance 1.03", or "-" where nothing was shared out.
std::string thread_use_text(const ThreadUse& use);

}  // namespace stiction::cli
