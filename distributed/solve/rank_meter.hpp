#pragma once

#include <chrono>

#include "distributed/solve/solve_over_ranks.hpp"

namespace stiction::distributed {

/// Measures a rank's messages and waits from here on.
class RankMeter {
 public:
  explicit RankMeter(const Transport& transport)
      : transport_(transport), before_(transport.traffic()), start_(std::chrono::steady_clock::now()) {}

  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }
  /// Adds exchanges, gathers, messages and bytes.
  template <class Counts>
  void add_messages_to(Counts& counts) const {
    const Traffic& after = transport_.traffic();
    counts.exchanges += after.exchanges - before_.exchanges;
    counts.gathers += after.gathers - before_.gathers;
    counts.messages += after.messages - before_.messages;
    counts.bytes += after.bytes - before_.bytes;
  }
  void add_to(RankReport& report) const {
    report.seconds += seconds();
    report.waited += transport_.traffic().waited - before_.waited;
    add_messages_to(report);
  }

 private:
  const Transport& transport_;
  Traffic before_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace stiction::distributed
