#pragma once

#include "core/base/real.hpp"

namespace stiction::inline STICTION_ISA {

/// Returns true if a reaction or a velocity can be started from: energies are made of its square.
template <class T>
STICTION_HD Mask<T> can_start_from(T guess) {
  return finite_(guess * guess);
}

}  // namespace stiction::inline STICTION_ISA
