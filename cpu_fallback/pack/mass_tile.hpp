#pragma once

#include <type_traits>

#include "core/base/row_tile.hpp"
#include "cpu_fallback/pack/pack_width.hpp"

namespace stiction::inline STICTION_ISA {

/// Rows of J that a core works on at once: eight, in any vectors, or one where there are none.
template <class Real>
using MassTile =
    std::conditional_t<kPackWidth<Real> == 1, RowTile<Real>,
                       RowTile<Pack<Real, kPackWidth<Real>>, (kPackWidth<Real> < 8 ? 8 / kPackWidth<Real> : 1)>>;

}  // namespace stiction::inline STICTION_ISA
