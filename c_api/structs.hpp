#pragma once

#include <cstddef>
#include <cstring>

#include "c_api/defaults.hpp"
#include "c_api/errors.hpp"

/// Structs of callers that may have been compiled against another version of the library. They begin with `size`; a
/// later version appends its fields after those there were, in whole multiples of the struct's alignment.
namespace stiction::c {

/// \throws Error(invalid_argument) unless `size` may be that of a struct of `whole` bytes from which some are missing.
void check_size(const char* argument, std::size_t size, std::size_t whole, std::size_t step);

/// A caller's struct in full: fields that it does not have get their defaults.
template <class Struct>
Struct read_struct(const Struct* given, const char* argument) {
  need(given, argument, "give it a struct that was set up by its init");
  std::size_t size = 0;
  std::memcpy(&size, given, sizeof size);
  check_size(argument, size, sizeof(Struct), alignof(Struct));
  Struct full;
  set_defaults(full);
  std::memcpy(&full, given, size);
  full.size = sizeof(Struct);
  return full;
}

/// Reads an argument that may be null: all defaults.
template <class Struct>
Struct read_optional(const Struct* given, const char* argument) {
  if (given != nullptr) return read_struct(given, argument);
  Struct full;
  set_defaults(full);
  return full;
}

/// As many fields of `full` as a caller's struct of that size has.
template <class Struct>
void write_struct(Struct* target, Struct full, std::size_t size) {
  full.size = size;
  std::memcpy(target, &full, size);
}

/// Defaults for a caller's struct of that size.
template <class Struct>
stiction_code init_struct(Struct* target, std::size_t size, const char* argument) {
  return guarded([&] {
    need(target, argument, "give it the struct to be set up");
    check_size(argument, size, sizeof(Struct), alignof(Struct));
    Struct full;
    set_defaults(full);
    write_struct(target, full, size);
  });
}

}  // namespace stiction::c
