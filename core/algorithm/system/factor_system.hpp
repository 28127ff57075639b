#pragma once

#include "core/algorithm/system/batch_order_system.hpp"

namespace stiction::inline STICTION_ISA {

/// Partial sums of a row's product with a velocity, over k = p, p + 4 and so on. They are few enough for every row of
/// a cone to have them among the leaves of a team.
inline constexpr Index kRowParts = 4;

/// An environment whose A is kept as Y Y', Y being n x dofs. The velocity u = Y' x stands between the rows, and a cone
/// reads its motion from it and pushes its change into it. A sweep visits cones one after the other (every cone
/// touches the one velocity) and costs 3 n dofs multiplications instead of n^2 (docs/howto/jacobian.md).
template <class RealType>
struct FactorSystem : FileOrderSystem<RealType> {
  using Real = RealType;

  Index dofs = 0;
  double* exact;       ///< velocity of the final residual, in double whatever Real is  (dofs)
  Strided<Real, 1> Y;  ///< factor in the solver's coordinates, row-major               (n * dofs)
  Strided<Real, 1> u;  ///< velocity Y' x                                               (dofs)

  static Offset elements(Offset rows, Offset cone_total, Offset dofs, const Workspace& workspace) {
    return FileOrderSystem<Real>::elements(rows, cone_total, workspace) + dofs * (rows + 3);
  }

  STICTION_HD FactorSystem(const EnvView<Real>& environment, const Workspace& workspace, Real* memory)
      : FileOrderSystem<Real>(environment),
        dofs(environment.dofs),
        // First, where any scratch is aligned for it.
        exact(reinterpret_cast<double*>(memory)) {
    Y = this->carve_all(memory + Offset{2} * dofs, workspace);
    u = Y.from(Offset{this->n} * dofs);
  }

  [[nodiscard]] STICTION_HD const Real* row(Index i) const { return Y.data + static_cast<Offset>(i) * dofs; }

  /// Part p of row i of Y times u.
  template <bool kAbsolute = false>
  [[nodiscard]] STICTION_HD_OUTLINE Real partial(Index i, Index p) const {
    const Real* const entry = row(i);
    Real sum(0);
    for (Index k = p; k < dofs; k += kRowParts) sum = fma_(kAbsolute ? abs_(entry[k]) : entry[k], u[k], sum);
    return sum;
  }

  /// All parts of it, one after the other in memory.
  template <bool kAbsolute = false>
  STICTION_HD_OUTLINE void partials(Index i, Real* sum) const {
    const Real* const entry = row(i);
    for (Index p = 0; p < kRowParts; ++p) sum[p] = Real(0);
    Index k = 0;
    for (; k + kRowParts <= dofs; k += kRowParts)
      for (Index p = 0; p < kRowParts; ++p)
        sum[p] = fma_(kAbsolute ? abs_(entry[k + p]) : entry[k + p], u[k + p], sum[p]);
    for (Index p = 0; k < dofs; ++k, ++p) sum[p] = fma_(kAbsolute ? abs_(entry[k]) : entry[k], u[k], sum[p]);
  }

  [[nodiscard]] static STICTION_HD Real fold(const Real* sum, Real start) {
    return start + ((sum[0] + sum[1]) + (sum[2] + sum[3]));
  }

  /// u = Y' in, each entry summed over rows in order; with |Y| on request.
  template <bool kAbsolute = false, Team TeamT>
  STICTION_HD_OUTLINE void project(TeamT& team, Strided<Real, 1> in) const {
    constexpr Index kTile = TeamT::kRowTile;
    for_each(team, (dofs + kTile - 1) / kTile, [&](Index tile) {
      const Index first = tile * kTile;
      const Index count = first + kTile <= dofs ? kTile : dofs - first;
      Real sum[kTile];
      for (Index t = 0; t < kTile; ++t) sum[t] = Real(0);
      for (Index i = 0; i < this->n; ++i) {
        const Real* const entry = row(i) + first;
        const Real factor = in[i];
        for (Index t = 0; t < count; ++t) sum[t] = fma_(kAbsolute ? abs_(entry[t]) : entry[t], factor, sum[t]);
      }
      for (Index t = 0; t < count; ++t) u[first + t] = sum[t];
    });
  }

  /// |Y| |Y'| stands for |A|, which it bounds entry by entry: a step that is safe for the bound is safe.
  template <bool kAbsolute = false, Team TeamT, class Base, class Store>
  STICTION_HD void multiply(TeamT& team, Strided<Real, 1> in, Base&& base, Store&& store) const {
    project<kAbsolute>(team, in);
    for_each(team, this->n, [&](Index i) {
      Real sum[kRowParts];
      partials<kAbsolute>(i, sum);
      store(i, fold(sum, fma_(this->R[i], in[i], base(i))));
    });
  }

  /// u += Y[row .. row+M)' d: the push of one cone's change.
  template <int M, Team TeamT>
  STICTION_HD void push(TeamT& team, Index first, const Real (&d)[M]) const {
    const Real* const entry = row(first);
    for_each(team, dofs, [&](Index k) {
      Real velocity = u[k];
      for (int r = 0; r < M; ++r) velocity = fma_(entry[static_cast<Offset>(r) * dofs + k], d[r], velocity);
      u[k] = velocity;
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
