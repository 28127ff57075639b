#pragma once

#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

struct Lemke : Pgs {
  static constexpr SolverKind kKind = SolverKind::lemke;
};

}  // namespace stiction::inline STICTION_ISA
