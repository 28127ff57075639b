#pragma once

#include <functional>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// Runs work(transport) on that many threads of this process, each a rank. An exception of one ends all of them within
/// the deadline, and is thrown when they have ended. The exception of a rank that only waited for it is not.
/// \throws Error(invalid_argument) unless ranks >= 1 and seconds > 0
void run_thread_ranks(int ranks, double deadline_seconds, const std::function<void(Transport&)>& work);

}  // namespace stiction::distributed
