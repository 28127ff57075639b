#pragma once

/// \file
/// The one exception that the library throws.

#include <stdexcept>
#include <string>

namespace stiction {

/// Kind of misuse or failure that an Error reports.
enum class ErrorCode {
  invalid_argument,  ///< an argument is wrong; the message names it, its value and the remedy
  bad_file,          ///< a file is not of the kind it claims
  io,                ///< the operating system refused to read or write
  out_of_memory,     ///< host or device memory
  no_device,         ///< the requested device is not there; the message says why
  device_failure,    ///< the device failed in a call; results of that call are not valid
  unsupported,       ///< this build lacks the feature; the message names the option that adds it
};

/// Thrown for misuse and device failure, before anything the caller owns is changed. Numerical and capacity
/// trouble is never thrown: it is data (EnvStatus).
class Error : public std::runtime_error {
 public:
  /// An error of that kind; what() returns `message`.
  Error(ErrorCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  /// Kind of the error.
  [[nodiscard]] ErrorCode code() const noexcept { return code_; }

 private:
  ErrorCode code_;
};

}  // namespace stiction
