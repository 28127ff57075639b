#pragma once

#include "core/base/macros.hpp"
#include "stiction/config.hpp"

namespace stiction::inline STICTION_ISA {

/// Two systems of the same slots whose sweeps alternate, cone by cone. They do not know of each other. Each gets the
/// bits it would get alone, while a core works on one during the other's roots and quotients.
template <class System>
struct SystemPair {
  using Real = typename System::Real;
  System& a;
  System& b;
};

/// A number of either.
template <class Real>
struct NumberPair {
  Real a;
  Real b;
};

/// System that a method iterates on: a system as it is, or two as a pair.
template <class System>
STICTION_HD System& as_pair(System& s) {
  return s;
}
template <class System>
STICTION_HD SystemPair<System> as_pair(System& a, System& b) {
  return {a, b};
}

}  // namespace stiction::inline STICTION_ISA
