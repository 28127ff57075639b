#pragma once

#include <array>
#include <cstddef>

#include "stiction/types.hpp"

namespace stiction {

/// One cone with its normal row first, wherever the batch has it.
struct ConeRows {
  std::size_t size = 0;
  std::array<double, kMaxConeRows> lambda{}, w{}, diagonal{}, mu{};
  double lo = 0, hi = 0;  ///< of a box row
};

/// The error of one cone [w] (docs/math/residual.md); infinite if a number is not finite.
double cone_error(const ConeRows& cone, ConeKind kind, Law law);

}  // namespace stiction
