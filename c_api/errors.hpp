#pragma once

#include <string>
#include <utility>

#include "stiction.h"

namespace stiction::c {

/// Keeps the text of the exception being handled for this thread, and returns its code.
stiction_code remember_failure() noexcept;

/// Runs f; its exceptions become a code and this thread's text.
template <class F>
stiction_code guarded(F&& f) noexcept {
  try {
    std::forward<F>(f)();
    return STICTION_OK;
  } catch (...) {
    return remember_failure();
  }
}

/// \throws Error(invalid_argument)
[[noreturn]] void refuse(const std::string& message);

/// \throws Error(invalid_argument) if an argument that a call cannot do without is null.
template <class T>
void need(const T* argument, const char* name, const char* remedy) {
  if (argument == nullptr) refuse(std::string(name) + " is null: " + remedy);
}

}  // namespace stiction::c
