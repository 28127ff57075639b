#pragma once

#include "core/algorithm/velocity/lanes/velocity_workspace.hpp"

namespace stiction::inline STICTION_ISA {

/// Scratch of a pack whose environments are differentiated: that of a solve, and more in double.
template <class Types>
struct JacobianPackWorkspace : VelocityWorkspace<Types> {
  using Base = VelocityWorkspace<Types>;
  double* system;        ///< H, then its factor                                    (tree entries; lanes)
  double* system_pivot;  ///< inverse pivots of H                                   (dofs; lanes)
  double* adjoint;       ///< a                                                     (dofs; lanes)
  double* force;         ///< M a as the reactions have it                          (dofs; lanes)
  double* slope_p;       ///< ReactionSlope::p; of a single row its slope          (rows; lanes)
  double* slope_q;       ///< ReactionSlope::q; of a single row -1 at lo, 1 at hi  (rows; lanes)
  double* nu;            ///< adjoint reaction                                      (rows; lanes)
  double* image;         ///< cotangents of the reactions, with their followers  (rows; lanes)
  /// By cone, in units of a slot: normal, inverse, bend, 1 where it slides          (4 slots; lanes)
  double* slope_of_cone;

  // Arrays of a solve that are something else here.
  /// By a slot's first row: -1 if the lane has no such cone, 1 if the row is unilateral         (rows)
  [[nodiscard]] STICTION_HD const typename Base::Numbers& marks() const { return this->prox_center; }
  [[nodiscard]] STICTION_HD const typename Base::Numbers& lambda_bar() const { return this->Jp; }
  [[nodiscard]] STICTION_HD const typename Base::Numbers& w_bar() const { return this->GJp; }
  [[nodiscard]] STICTION_HD const typename Base::Numbers& v_bar() const { return this->step; }

  static STICTION_HD constexpr Offset own_doubles(const SlotCounts& counts, Index dofs, Index tree_entries) {
    return Base::kStride *
           (Offset{tree_entries} + 3 * Offset{dofs} + 4 * Offset{counts.rows} + 4 * Offset{counts.slots});
  }
  /// Doubles that a workspace takes.
  static STICTION_HD constexpr Offset doubles(const SlotCounts& counts, Index dofs, Index tree_entries) {
    return own_doubles(counts, dofs, tree_entries) + Base::doubles(counts, dofs, tree_entries);
  }

  /// `lane`: which of kStride lanes that share the memory; 0 for a pack.
  STICTION_HD JacobianPackWorkspace(double* memory, const SlotCounts& counts, Index dofs, Index tree_entries,
                                    Index lane = 0)
      : Base(memory + own_doubles(counts, dofs, tree_entries), counts, dofs, tree_entries, lane) {
    const auto take = [&memory, lane](Offset count) {
      double* const part = memory + lane;
      memory += count * Base::kStride;
      return part;
    };
    system = take(tree_entries);
    for (double** part : {&system_pivot, &adjoint, &force}) *part = take(dofs);
    for (double** part : {&slope_p, &slope_q, &nu, &image}) *part = take(counts.rows);
    slope_of_cone = take(4 * Offset{counts.slots});
  }
};

}  // namespace stiction::inline STICTION_ISA
