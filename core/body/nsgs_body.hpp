#pragma once

#include "core/body/pgs_body.hpp"

namespace stiction::inline STICTION_ISA {

struct Nsgs : Pgs {
  static constexpr SolverKind kKind = SolverKind::nsgs;
};

}  // namespace stiction::inline STICTION_ISA
