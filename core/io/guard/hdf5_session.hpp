#pragma once

#include <hdf5.h>

#include <mutex>
#include <string>
#include <utility>

namespace stiction::io {

/// An HDF5 identifier that is closed when it goes.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle() = default;
  Handle(hid_t id, Close closer) noexcept : id_(id), close_(closer) {}
  Handle(Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  [[nodiscard]] hid_t get() const noexcept { return id_; }
  [[nodiscard]] bool ok() const noexcept { return id_ >= 0; }
  /// Closes now and returns true if that succeeded: for files, closing writes.
  bool close() noexcept { return id_ < 0 || close_(std::exchange(id_, -1)) >= 0; }

 private:
  hid_t id_ = -1;
  Close close_ = nullptr;
};

/// Everything this library asks of HDF5 happens inside a session. Not every build of HDF5 is thread-safe, so a session
/// holds a lock. HDF5 prints its error stack, so printing is off. A file may name a filter that HDF5 would fetch as a
/// plugin, that is, run code of the file's choosing. Plugins are therefore off. Both settings are restored, since the
/// host program may use HDF5 as well.
class Session {
 public:
  Session();
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

 private:
  std::lock_guard<std::recursive_mutex> lock_;
  H5E_auto2_t print_ = nullptr;
  void* print_data_ = nullptr;
  unsigned plugins_ = 0;
};

/// The innermost reason on HDF5's error stack, as " (HDF5: ...)", or nothing.
std::string hdf5_reason();

}  // namespace stiction::io
