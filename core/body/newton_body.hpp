#pragma once

#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

struct Newton : Pgs {
  static constexpr SolverKind kKind = SolverKind::newton;
};

}  // namespace stiction::inline STICTION_ISA
