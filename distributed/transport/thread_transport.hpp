#pragma once

#include <functional>

#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// Runs work(transport) on that many threads of this process, each a rank. An exception of one ends all of them within
/// the deadline, and is thrown when they have ended. The exception of a rank that only waited for it is not.
/// \throws Error(invalid_argument) unless ranks >= 1 and seconds > 0
void run_thread_ranks(int ranks, double deadline_seconds, const std::function<void(Transport&)>& work);

/// A rank with a clock, which goes on when it is told to, and while it waits: to when what it waits for arrives.
class ClockedTransport : public Transport {
 public:
  /// The rank works for that long.
  virtual void advance(double seconds) = 0;
  [[nodiscard]] virtual double seconds() const = 0;
};

/// As run_thread_ranks(), on clocks. What is sent arrives `latency` seconds later, and a rank takes the letters that
/// have arrived by its clock. So times, what is taken and all that follows are the same on every machine, however busy
/// it is. \throws Error(invalid_argument) also unless latency >= 0
void run_clocked_ranks(int ranks, double deadline_seconds, double latency,
                       const std::function<void(ClockedTransport&)>& work);

}  // namespace stiction::distributed
