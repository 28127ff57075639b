#pragma once

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

namespace stiction::inline STICTION_ISA {

/// Iterations between two checks of the residual. Part of the numerics epoch: environments stop at multiples of it.
inline constexpr Index kChunk = 4;

/// Options of an iteration, as numbers of the solve's precision.
template <class Real>
struct MethodParams {
  Real omega;
  bool is_fallback_stage =
      false;  ///< of the fallback chain: environments are tried in any case, from the answer there is
};

}  // namespace stiction::inline STICTION_ISA
