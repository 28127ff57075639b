#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

/// Numbers that a field of the C interface may have, with their names for the message that refuses another one.
namespace stiction::c {

struct Named {
  std::int32_t value;
  const char* name;
};

/// An enumerator with its name, after a look that it is the C++ one.
#define STICTION_SAME(c_name, cpp_name)                                                      \
  [] {                                                                                       \
    static_assert(static_cast<std::int32_t>(c_name) == static_cast<std::int32_t>(cpp_name)); \
    return stiction::c::Named{c_name, #c_name};                                              \
  }()

/// The value, if it is one of those known.
std::int32_t checked(const char* field, std::int32_t value, std::span<const Named> known);

template <class E, std::size_t kCount>
E checked_as(const char* field, std::int32_t value, const Named (&known)[kCount]) {
  return static_cast<E>(checked(field, value, known));
}

}  // namespace stiction::c
