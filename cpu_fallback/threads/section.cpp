#include "cpu_fallback/threads/section.hpp"

#include <cstddef>
#include <utility>

#include "stiction/trace.hpp"

namespace stiction::cpu {

namespace {

/// A call from within an item is part of that item's work.
thread_local bool is_within = false;

double seconds_of(Section::Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

ThreadMeter* Section::meter() noexcept {
  return is_within ? nullptr : ThreadMeter::current();
}

Section::Section(ThreadMeter& meter, int threads)
    : meter_(meter), places_(static_cast<std::size_t>(threads > 1 ? threads : 1)) {
  for (Place& place : places_) place.left = begin_;
  is_within = true;
}

Section::~Section() {
  is_within = false;
  const Clock::time_point end = Clock::now();
  std::vector<double> busy;
  for (const Place& place : places_) busy.push_back(seconds_of(place.busy));
  meter_.add(seconds_of(end - begin_), std::move(busy));
  Tracer* const tracer = meter_.tracer();
  if (tracer == nullptr) return;
  const double now = tracer->now();
  for (std::size_t k = 0; k < places_.size(); ++k) {
    const double waited = 1e6 * seconds_of(end - places_[k].left);
    tracer->add({"wait", nullptr, SpanPlace::host, static_cast<int>(k), -1, now - waited, waited});
  }
}

void Section::worked(int place, Clock::time_point start, Clock::duration waited) {
  Place& own = places_[static_cast<std::size_t>(place)];
  own.left = Clock::now();
  own.busy += own.left - start - waited;
}

}  // namespace stiction::cpu
