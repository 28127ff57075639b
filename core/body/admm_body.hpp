#pragma once

#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

struct Admm : Pgs {
  static constexpr SolverKind kKind = SolverKind::admm;
};

}  // namespace stiction::inline STICTION_ISA
