#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "cuda/api/memory.hpp"

namespace stiction::cuda {

/// Arrays of the host that live on a device. One is copied where the host asks for it, and back where the host has
/// changed it. Arrays that the host has asked for are compared with a copy before work on the device, so that no
/// change is lost.
class ResidentArrays {
 public:
  explicit ResidentArrays(DeviceApi& api) : api_(api) {}

  /// One more array, and the device's copy of it. `is_written`: by work on the device.
  template <class T>
  void add(std::string name, const T* host, const T* there, Offset count, bool is_written) {
    if (count == 0 || host == nullptr) return;
    arrays_.push_back(
        {std::move(name), bytes_of(host), bytes_of(there), static_cast<std::size_t>(count) * sizeof(T), is_written});
  }
  /// Queues copies of all to the device.
  void queue_all_to_device(StreamHandle stream);

  /// The host's array that begins there is as the device's. The host may change it: until work that writes it, or
  /// always if there is none.
  void open(const void* array, StreamHandle stream);
  /// Returns true if the host has changed what it has asked for.
  [[nodiscard]] bool has_changes() const;
  /// Copies what the host has changed to the device, and waits for that. \throws Error(invalid_argument) if it was
  /// changed when it was no longer open.
  void give_back(StreamHandle stream);
  /// Queues a copy from memory of the device to its copy of an array.
  void overwrite(const void* array, const void* from, std::size_t bytes, StreamHandle stream);
  /// Work is queued that writes one array on the device.
  void leave(const void* array);
  /// Work is queued that writes on the device.
  void note_work();
  /// From now on the device's copies may change at any time.
  void share() { is_shared_ = true; }

 private:
  struct Resident {
    std::string name;
    std::byte* host;
    std::byte* there;
    std::size_t bytes;
    bool is_written;
    bool is_current = true;            ///< the device has not changed it since it was copied
    bool is_open = false;              ///< the host may change it
    std::vector<std::byte> seen = {};  ///< what the host was given; empty: it has not asked
    [[nodiscard]] bool is_changed() const;
    void leave();
  };

  template <class T>
  static std::byte* bytes_of(T* array) {
    return const_cast<std::byte*>(reinterpret_cast<const std::byte*>(array));
  }
  /// The array that an address is in; null: none.
  Resident* find(const void* address);

  DeviceApi& api_;
  std::vector<Resident> arrays_;
  bool is_shared_ = false;
};

}  // namespace stiction::cuda
