#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>

#include "c_api/errors.hpp"

namespace stiction::c {

/// A number that no handle has had before, and no address of an object either.
std::uintptr_t next_ticket() noexcept;

/// Names of a handle in texts.
struct HandleNames {
  const char* argument;
  const char* type;
  const char* maker;  ///< the call that makes one
};

/// \throws Error(invalid_argument) for a handle that is null or not in its table.
[[noreturn]] void refuse_handle(const HandleNames& names, std::uintptr_t ticket);

/// The objects behind one type of handle. Handles are tickets, so that one that was destroyed, or is of another type,
/// is refused instead of followed. A call holds its object until it returns. The tables are never destroyed: programs
/// may use their handles while they exit.
template <class Handle, class Object>
class HandleTable {
 public:
  explicit HandleTable(const HandleNames& names) : names_(names) {}

  Handle* add(std::shared_ptr<Object> object) {
    const std::uintptr_t ticket = next_ticket();
    const std::lock_guard lock(mutex_);
    objects_.emplace(ticket, std::move(object));
    return reinterpret_cast<Handle*>(ticket);
  }

  std::shared_ptr<Object> get(Handle* handle) const {
    const auto ticket = reinterpret_cast<std::uintptr_t>(handle);
    const std::lock_guard lock(mutex_);
    const auto found = objects_.find(ticket);
    if (found == objects_.end()) refuse_handle(names_, ticket);
    return found->second;
  }

  /// Null is no error.
  void remove(Handle* handle) {
    if (handle == nullptr) return;
    const std::shared_ptr<Object> last = get(handle);
    const std::lock_guard lock(mutex_);
    objects_.erase(reinterpret_cast<std::uintptr_t>(handle));
  }

 private:
  HandleNames names_;
  mutable std::mutex mutex_;
  std::unordered_map<std::uintptr_t, std::shared_ptr<Object>> objects_;
};

}  // namespace stiction::c
