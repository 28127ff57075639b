#include "stiction/thread_meter.hpp"

#include <cstddef>
#include <utility>

namespace stiction {

namespace {

thread_local ThreadMeter* current_meter = nullptr;

}  // namespace

double ThreadUse::synchronisation_share() const noexcept {
  if (available <= 0) return 0;
  double work = 0;
  for (const double seconds_of_one : busy) work += seconds_of_one;
  return 1 - work / available;
}

double ThreadUse::imbalance() const noexcept {
  double work = 0;
  double largest = 0;
  for (const double seconds_of_one : busy) {
    work += seconds_of_one;
    if (seconds_of_one > largest) largest = seconds_of_one;
  }
  return work > 0 ? largest * static_cast<double>(busy.size()) / work : 1;
}

ThreadUse& ThreadUse::operator+=(const ThreadUse& more) {
  seconds += more.seconds;
  available += more.available;
  if (busy.size() < more.busy.size()) busy.resize(more.busy.size());
  for (std::size_t k = 0; k < more.busy.size(); ++k) busy[k] += more.busy[k];
  return *this;
}

ThreadMeter::ThreadMeter(Tracer* tracer) noexcept : tracer_(tracer), outer_(current_meter) {
  current_meter = this;
}

ThreadMeter::~ThreadMeter() {
  current_meter = outer_;
}

ThreadMeter* ThreadMeter::current() noexcept {
  return current_meter;
}

void ThreadMeter::add(double seconds, std::vector<double> busy) {
  const double available = seconds * static_cast<double>(busy.size());
  use_ += {seconds, available, std::move(busy)};
}

}  // namespace stiction
