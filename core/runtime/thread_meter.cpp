#include "stiction/thread_meter.hpp"

#include <cstddef>

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

ThreadMeter::ThreadMeter(Tracer* tracer) noexcept : tracer_(tracer), outer_(current_meter) {
  current_meter = this;
}

ThreadMeter::~ThreadMeter() {
  current_meter = outer_;
}

ThreadMeter* ThreadMeter::current() noexcept {
  return current_meter;
}

void ThreadMeter::add(double seconds, std::span<const double> busy) {
  use_.seconds += seconds;
  use_.available += seconds * static_cast<double>(busy.size());
  if (use_.busy.size() < busy.size()) use_.busy.resize(busy.size());
  for (std::size_t k = 0; k < busy.size(); ++k) use_.busy[k] += busy[k];
}

}  // namespace stiction
