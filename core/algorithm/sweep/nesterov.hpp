#pragma once

#include "core/base/real.hpp"

namespace stiction::inline STICTION_ISA {

/// State of an iteration with Nesterov's theta (docs/math/npgs.md, 1).
template <class Real>
struct NesterovStep {
  Real next;  ///< theta of the iteration after it
  Real beta;  ///< factor of the extrapolation of the last change; 0 at theta = 1
};

/// theta' solves theta'^2 = (1 - theta') theta^2.
template <class Real>
STICTION_HD NesterovStep<Real> nesterov_step(Real theta) {
  const Real square = theta * theta;
  const Real next = Real(0.5) * (sqrt_(fma_(square, square, Real(4) * square)) - square);
  return {next, div_(theta * (Real(1) - theta), square + next)};
}

}  // namespace stiction::inline STICTION_ISA
