#pragma once

#include "cuda/api/device_api.hpp"
#include "stiction/error.hpp"
#include "stiction/types.hpp"

namespace stiction::cuda {

/// Copies to and from a device, of arrays that may be empty.
class Mover {
 public:
  Mover(DeviceApi& api, StreamHandle stream) : api_(api), stream_(stream) {}
  template <class T>
  void to_device(const T* target, const T* source, Offset count) {
    move(const_cast<T*>(target), source, count, CopyKind::to_device);
  }
  template <class T>
  void to_host(T* target, const T* source, Offset count) {
    move(target, source, count, CopyKind::to_host);
  }

 private:
  template <class T>
  void move(T* target, const T* source, Offset count, CopyKind kind) {
    if (count > 0 && target != nullptr && source != nullptr)
      api_.copy(static_cast<void*>(target), static_cast<const void*>(source),
                static_cast<std::size_t>(count) * sizeof(T), kind, stream_);
  }
  DeviceApi& api_;
  StreamHandle stream_;
};

/// Queues work by f(). If that fails half way, queued work is waited for: it uses memory the caller is about to give
/// back.
template <class F>
void queue_all(DeviceApi& api, StreamHandle stream, F&& f) {
  try {
    f();
  } catch (...) {
    try {
      api.synchronize(stream);
    } catch (const Error&) {
      // The first failure is the one to report; a device that is lost has nothing queued.
    }
    throw;
  }
}

}  // namespace stiction::cuda
