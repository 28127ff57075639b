#include "c_api/errors.hpp"

#include <exception>
#include <new>

#include "c_api/enums.hpp"
#include "stiction/error.hpp"

namespace stiction::c {

namespace {

/// A text that memory may run out for.
struct LastError {
  std::string text;
  const char* shown = "";

  void keep(const char* message) noexcept {
    try {
      text = message;
      shown = text.c_str();
    } catch (...) {
      shown = "memory ran out while the error's text was kept";
    }
  }
};

thread_local LastError last_error;

}  // namespace

stiction_code remember_failure() noexcept {
  try {
    throw;
  } catch (const Error& error) {
    last_error.keep(error.what());
    return code_of(error.code());
  } catch (const std::bad_alloc&) {
    last_error.keep("memory ran out on the host");
    return STICTION_OUT_OF_MEMORY;
  } catch (const std::exception& error) {
    last_error.keep(error.what());
  } catch (...) {
    last_error.keep("an exception that is no std::exception");
  }
  return STICTION_INTERNAL;
}

void refuse(const std::string& message) {
  throw Error(ErrorCode::invalid_argument, message);
}

}  // namespace stiction::c

const char* stiction_last_error(void) {
  return stiction::c::last_error.shown;
}
