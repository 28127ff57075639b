#pragma once

#include <limits>

#include "tests/fuzz/bytes.hpp"

namespace stiction::fuzz {

/// A number of everyday size, in steps of 1/16 from -8 to 8.
template <class Real>
Real tame(Bytes& bytes) {
  return static_cast<Real>(bytes.byte() - 128) / 16;
}

/// A number in 0 .. 1.
template <class Real>
Real share(Bytes& bytes) {
  return static_cast<Real>(bytes.byte()) / 255;
}

/// Any number there is; half of them are those that arithmetic trips over.
template <class Real>
Real wild(Bytes& bytes) {
  using Limits = std::numeric_limits<Real>;
  constexpr Real kEdges[] = {Limits::quiet_NaN(),
                             Limits::infinity(),
                             -Limits::infinity(),
                             Limits::max(),
                             Limits::lowest(),
                             Limits::min(),
                             Limits::denorm_min(),
                             -Limits::denorm_min(),
                             Limits::epsilon(),
                             Real(0),
                             -Real(0),
                             Real(1),
                             Real(-1),
                             Real(1e18),
                             Real(-1e18),
                             Real(1e-18),
                             Real(1e30),
                             Real(1e-30)};
  switch (bytes.below(4)) {
    case 0:
      return tame<Real>(bytes);
    case 1:
      return bytes.raw<Real>();
    default:
      return bytes.one_of(kEdges);
  }
}

}  // namespace stiction::fuzz
