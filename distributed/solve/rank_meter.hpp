#pragma once

#include <chrono>

#include "distributed/solve/solve_over_ranks.hpp"

namespace stiction::distributed {

/// What a rank sends and waits for from here on.
class RankMeter {
 public:
  explicit RankMeter(const Transport& transport)
      : transport_(transport), before_(transport.traffic()), start_(std::chrono::steady_clock::now()) {}

  void add_to(RankReport& report) const {
    report.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    const Traffic& after = transport_.traffic();
    report.waited += after.waited - before_.waited;
    report.exchanges += after.exchanges - before_.exchanges;
    report.gathers += after.gathers - before_.gathers;
    report.messages += after.messages - before_.messages;
    report.bytes += after.bytes - before_.bytes;
  }

 private:
  const Transport& transport_;
  Traffic before_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace stiction::distributed
