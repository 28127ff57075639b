#include "cuda/machine/stream_timer.hpp"

#include <exception>
#include <utility>

#include "stiction/error.hpp"

namespace stiction::cuda {

void StreamTimer::attach(Tracer* tracer, bool capturing) {
  tracer_ = nullptr;
  if (tracer == nullptr || capturing) return;
  collect();
  owner_ = tracer;
  // Clocks drift apart, so they are compared again whenever nothing is under way.
  if (pending_.empty()) set_zero();
  tracer_ = tracer;
}

void StreamTimer::set_zero() {
  if (stream_ == nullptr) stream_ = std::make_unique<Stream>(api_);
  if (zero_ == nullptr) zero_ = std::make_unique<Event>(api_, EventUse::timing);
  api_.record(zero_->get(), stream_->get());
  api_.await(zero_->get());
  zero_time_ = owner_->now();
}

StreamTimer::Timed* StreamTimer::begin(const char* name, const char* detail, int lane, StreamHandle stream) {
  if (pending_.size() == kMostPending) collect();
  if (pending_.size() == kMostPending) {
    tracer_->leave_out(1);
    return nullptr;
  }
  if (unused_.empty()) unused_.push_back(std::make_unique<Timed>(api_));
  std::unique_ptr<Timed> timed = std::move(unused_.back());
  unused_.pop_back();
  timed->complete = false;
  timed->span = {name, detail, SpanPlace::device, lane, -1, 0, 0};
  api_.record(timed->begin.get(), stream);
  pending_.push_back(std::move(timed));
  return pending_.back().get();
}

bool StreamTimer::export_spans(const Timed& timed) {
  if (!timed.complete) {
    owner_->leave_out(1);
    return true;
  }
  const auto start = api_.microseconds(zero_->get(), timed.begin.get());
  const auto end = api_.microseconds(zero_->get(), timed.end.get());
  if (!start || !end) return false;
  Span span = timed.span;
  span.start = zero_time_ + *start;
  span.duration = *end - *start;
  owner_->add(span);
  return true;
}

void StreamTimer::collect() noexcept {
  if (pending_.empty()) return;
  try {
    std::vector<std::unique_ptr<Timed>> waiting;
    waiting.reserve(pending_.size());
    unused_.reserve(unused_.size() + pending_.size());
    for (auto& timed : pending_) (export_spans(*timed) ? unused_ : waiting).push_back(std::move(timed));
    pending_ = std::move(waiting);
  } catch (const std::exception&) {
    owner_->leave_out(pending_.size());
    pending_.clear();
  }
}

}  // namespace stiction::cuda
