#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "stiction/captured_calls.hpp"

namespace stiction::python {

/// Objects whose calls became part of CUDA graphs. They live as long as this, whatever is put in their place: graphs
/// have pointers to their memory.
class CapturedObjects {
 public:
  /// f(*object); keeps the object if the stream was being captured, also where the call failed half-way.
  template <class T, class F>
  void call(const std::shared_ptr<T>& object, const F& f) {
    const std::uint64_t before = captured_calls();
    try {
      f(*object);
    } catch (...) {
      keep(object, before);
      throw;
    }
    keep(object, before);
  }

 private:
  void keep(const std::shared_ptr<const void>& object, std::uint64_t before) {
    if (captured_calls() == before) return;
    const std::lock_guard lock(mutex_);
    if (kept_.empty() || kept_.back() != object) kept_.push_back(object);
  }

  std::mutex mutex_;
  std::vector<std::shared_ptr<const void>> kept_;
};

}  // namespace stiction::python
