#pragma once

#include <cstddef>
#include <string>

#include "stiction/error.hpp"

/// Checks of a caller's arguments, before anything is changed.
namespace stiction {

[[noreturn]] inline void refuse(const std::string& message) {
  throw Error(ErrorCode::invalid_argument, message);
}

inline void expect_length(const char* name, std::size_t got, std::size_t expected, const char* because) {
  if (got == expected) return;
  refuse(std::string(name) + " has " + std::to_string(got) + " entries, expected " + std::to_string(expected) + " (" +
         because + ")");
}

}  // namespace stiction
