#pragma once

#include <nanobind/nanobind.h>

#include <chrono>

namespace stiction::python {

/// Lets Python's signal handlers run between steps, so that Ctrl-C ends a call of many. They need the interpreter's
/// lock, which other threads may hold for milliseconds; so it is asked for ten times a second.
class SignalCheck {
 public:
  /// Called without the lock. \throws nanobind::python_error with a handler's exception.
  void look() {
    const Clock::time_point now = Clock::now();
    if (now < next_) return;
    next_ = now + kPause;
    const nanobind::gil_scoped_acquire locked;
    if (PyErr_CheckSignals() != 0) throw nanobind::python_error();
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kPause{100};
  Clock::time_point next_ = Clock::now() + kPause;
};

}  // namespace stiction::python
