#pragma once

#include "core/base/multigrid_view.hpp"
#include "core/body/linear/block_diagonal.hpp"

namespace stiction::inline STICTION_ISA {

/// Aggregation multigrid as a preconditioner (docs/math/multigrid.md): one cycle, symmetric positive definite.
struct Multigrid {
  MultigridView plan;
  Cycle cycle = Cycle::v;
  double* memory = nullptr;  ///< (doubles(plan))
  BlockMatrix finest;        ///< as given to prepare()

  static STICTION_HD Offset doubles(const MultigridView& plan);

  /// Takes H = M + J'WJ, which must live on as long as apply() is called, and the bodies' positions, three for each,
  /// from any origin. Every lane calls it on a Multigrid of its own.
  template <Block B>
  STICTION_HD_OUTLINE void prepare(B& block, const BlockMatrix& H, const double* positions);

  /// z = one cycle for H z = r from z = 0; r and z apart, 6 doubles a body.
  template <Block B>
  STICTION_HD_OUTLINE void apply(B& block, const double* r, double* z) const;
};

}  // namespace stiction::inline STICTION_ISA
