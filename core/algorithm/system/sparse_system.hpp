#pragma once

#include "core/algorithm/system/batch_order_system.hpp"

namespace stiction::inline STICTION_ISA {

/// An environment on the batch's own sparsity pattern. Cones of one colour share no entry, so a colour is one parallel
/// phase (docs/math/pgs.md).
template <class RealType>
struct SparseSystem : FileOrderSystem<RealType> {
  using Real = RealType;

  Strided<Real, 1> value;  ///< CSR values in the solver's coordinates, without R  (entry span)

  static Offset elements(Offset rows, Offset cone_total, Offset nonzeros, const Workspace& workspace) {
    return FileOrderSystem<Real>::elements(rows, cone_total, workspace) + nonzeros;
  }

  STICTION_HD SparseSystem(const EnvView<Real>& environment, const Workspace& workspace, Real* memory)
      : FileOrderSystem<Real>(environment) {
    value = this->carve_all(memory, workspace);
  }

  /// start + row i of A times in, over four interleaved partial sums in stored order; in double if `in` is.
  template <bool kAbsolute = false, class In, class Sum>
  [[nodiscard]] STICTION_HD Sum gather(Index i, const In& in, Sum start) const {
    const EnvView<Real>& own = *this->env;
    const Offset begin = own.row_offsets[i];
    const Real* a = value.data + (begin - own.row_offsets[0]);
    const Index* column = own.columns(i);
    const Offset count = own.entries(i);
    const auto entry = [](Real v) { return static_cast<Sum>(kAbsolute ? abs_(v) : v); };
    Sum sum[4] = {start, Sum(0), Sum(0), Sum(0)};
    Offset k = 0;
    for (; k + 4 <= count; k += 4)
      for (int lane = 0; lane < 4; ++lane) sum[lane] = fma_(entry(a[k + lane]), in[column[k + lane]], sum[lane]);
    for (int lane = 0; k < count; ++k, ++lane) sum[lane] = fma_(entry(a[k]), in[column[k]], sum[lane]);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
  }

  template <bool kAbsolute = false, Team TeamT, class Base, class Store>
  STICTION_HD void multiply(TeamT& team, Strided<Real, 1> in, Base&& base, Store&& store) const {
    for_each(team, this->n, [&](Index i) { store(i, gather<kAbsolute>(i, in, fma_(this->R[i], in[i], base(i)))); });
  }
};

}  // namespace stiction::inline STICTION_ISA
