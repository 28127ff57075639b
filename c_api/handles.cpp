#include "c_api/handles.hpp"

#include <atomic>

namespace stiction::c {

std::uintptr_t next_ticket() noexcept {
  // Odd, as no address of an object that has an alignment is.
  static std::atomic<std::uintptr_t> next{1};
  return next.fetch_add(2, std::memory_order_relaxed);
}

void refuse_handle(const HandleNames& names, std::uintptr_t ticket) {
  if (ticket == 0) refuse(std::string(names.argument) + " is null: make one with " + names.maker);
  refuse(std::string(names.argument) + " is no live " + names.type +
         ": it was destroyed, or is something else; make one with " + names.maker + " and keep it until its last use");
}

}  // namespace stiction::c
