#pragma once

#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

struct Ipm : Pgs {
  static constexpr SolverKind kKind = SolverKind::ipm;
};

}  // namespace stiction::inline STICTION_ISA
