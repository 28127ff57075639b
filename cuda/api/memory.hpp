#pragma once

#include <utility>
#include <vector>

#include "cuda/api/device_api.hpp"

namespace stiction::cuda {

/// Alignment of memory that a device allocates, and of the arrays that share one allocation [bytes].
inline constexpr std::size_t kDeviceAlignment = 256;
/// Bytes of an array up to where the next one begins.
inline constexpr std::size_t padded_bytes(std::size_t bytes) {
  return (bytes + kDeviceAlignment - 1) / kDeviceAlignment * kDeviceAlignment;
}

/// Owner of memory of a device, or of pinned memory of the host.
template <bool kPinned>
class Memory {
 public:
  Memory() = default;
  Memory(DeviceApi& api, std::size_t bytes) : api_(&api), bytes_(bytes) {
    if (bytes > 0) data_ = kPinned ? api.allocate_pinned(bytes) : api.allocate(bytes);
  }
  ~Memory() {
    if (data_ == nullptr) return;
    if (kPinned)
      api_->release_pinned(data_);
    else
      api_->release(data_);
  }
  Memory(Memory&& other) noexcept
      : api_(other.api_), data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
  Memory& operator=(Memory&& other) noexcept {
    std::swap(api_, other.api_);
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  /// Has room for that many bytes, earlier contents lost; growing memory gets an eighth more, to grow less often.
  void make_room(DeviceApi& api, std::size_t bytes) {
    if (data_ != nullptr && bytes_ >= bytes) return;
    const std::size_t spare = bytes_ > 0 ? bytes / 8 : 0;
    *this = Memory();
    *this = Memory(api, bytes + spare);
  }
  [[nodiscard]] std::byte* get() const noexcept { return static_cast<std::byte*>(data_); }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

 private:
  DeviceApi* api_ = nullptr;
  void* data_ = nullptr;
  std::size_t bytes_ = 0;
};
using DeviceMemory = Memory<false>;
using PinnedMemory = Memory<true>;

/// Several arrays in one block of memory: add each, ask for bytes(), and place() sets each pointer.
class ArraySet {
 public:
  template <class T>
  void add(T*& target, Offset count) {
    entries_.push_back(
        {static_cast<void*>(&target), static_cast<std::size_t>(count) * sizeof(T),
         [](void* where, std::byte* memory) { *static_cast<T**>(where) = reinterpret_cast<T*>(memory); }});
    bytes_ += padded_bytes(entries_.back().bytes);
  }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }
  void place(std::byte* memory) const {
    for (const Entry& entry : entries_) {
      entry.assign(entry.target, memory);
      memory += padded_bytes(entry.bytes);
    }
  }

 private:
  struct Entry {
    void* target;
    std::size_t bytes;
    void (*assign)(void* where, std::byte* memory);
  };

  std::vector<Entry> entries_;
  std::size_t bytes_ = 0;
};

/// Owner of a stream or an event.
class Stream {
 public:
  explicit Stream(DeviceApi& api) : api_(&api), handle_(api.create_stream()) {}
  ~Stream() { api_->destroy_stream(handle_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  [[nodiscard]] StreamHandle get() const noexcept { return handle_; }

 private:
  DeviceApi* api_;
  StreamHandle handle_;
};

class Event {
 public:
  explicit Event(DeviceApi& api, EventUse use = EventUse::ordering) : api_(&api), handle_(api.create_event(use)) {}
  ~Event() { api_->destroy_event(handle_); }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  [[nodiscard]] EventHandle get() const noexcept { return handle_; }

 private:
  DeviceApi* api_;
  EventHandle handle_;
};

}  // namespace stiction::cuda
