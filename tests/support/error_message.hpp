#pragma once

#include <string>

#include "stiction/error.hpp"

namespace stiction::test {

/// The message of the Error that f() throws, empty if it throws none.
template <class F>
std::string error_message(F&& f) {
  try {
    f();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace stiction::test
