#pragma once

#include <functional>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// Runs work(transport) on that many threads of this process, each a rank. An exception of one ends all of them within
/// the deadline, and is thrown when they have ended. The exception of a rank that only waited for it is not.
/// \throws Error(invalid_argument) unless ranks >= 1 and seconds > 0
void run_thread_ranks(int ranks, double deadline_seconds, const std::function<void(Transport&)>& work);

/// A rank with a clock, which advances by calls, and while it waits: to the arrival of a letter.
class ClockedTransport : public Transport {
 public:
  /// The rank works for that long.
  virtual void advance(double seconds) = 0;
  [[nodiscard]] virtual double seconds() const = 0;
};

/// As run_thread_ranks(), on clocks. A letter arrives `latency` seconds after it is sent, and a rank takes those that
/// have arrived by its clock. Times, letters taken and all that follows are hence the same on every machine, however
/// busy it is. \throws Error(invalid_argument) also unless latency >= 0
void run_clocked_ranks(int ranks, double deadline_seconds, double latency,
                       const std::function<void(ClockedTransport&)>& work);

}  // namespace stiction::distributed
