#pragma once

#include "core/algorithm/problem/cone_shape.hpp"
#include "core/algorithm/problem/env_view.hpp"
#include "core/algorithm/system/system_arrays.hpp"
#include "core/team/phases.hpp"
#include "core/team/reduce.hpp"

namespace stiction::inline STICTION_ISA {

/// Base of systems that keep rows and cones in the batch's order. Motion is pulled: a cone gathers its rows of (A +
/// diag R) x + b when it is visited.
template <class RealType>
struct FileOrderSystem : SystemArrays<RealType, 1> {
  using Real = RealType;
  static constexpr int kStride = 1;
  static constexpr bool kMaintainsMotion = false;

  const EnvView<Real>* env = nullptr;
  Index n = 0;
  Index cones = 0;
  Strided<Real, 1> R;       ///< compliance in the solver's coordinates             (n)
  Strided<Real, 1> blocks;  ///< diagonal block of the cone at row r from 6 r on    (6 n)

  static Offset elements(Offset rows, Offset cone_total, const Workspace& workspace) {
    return SystemArrays<Real, 1>::elements(rows, cone_total, workspace) + 7 * rows;
  }

  STICTION_HD explicit FileOrderSystem(const EnvView<Real>& environment)
      : env(&environment), n(environment.n), cones(environment.cone_count) {}

  /// Lays all arrays out; returns the first element behind them.
  STICTION_HD Strided<Real, 1> carve_all(Real* memory, const Workspace& workspace) {
    R = this->carve({this->carve_wide(memory, n, workspace)}, n, cones, workspace);
    blocks = R.from(n);
    return blocks.from(Offset{6} * n);
  }

  [[nodiscard]] STICTION_HD Real block_entry(Index row, int i, int j) const { return blocks[row * 6 + i * 6 + j]; }

  [[nodiscard]] STICTION_HD Strided<Real, 1> vector(Index k) const { return this->extra.from(Offset{k} * n); }

  template <Team TeamT, class F>
  STICTION_HD void for_each_cone(TeamT& team, F&& f) const {
    for_each(team, cones, [&](Index cone) {
      with_shape(env->kind[cone], env->cone_size(cone), [&](auto shape) { f(shape, cone, env->cone_row(cone)); });
    });
  }

  template <Team TeamT, class F>
  STICTION_HD Real sum_over_cones(TeamT& team, F&& f) const {
    return sum_leaves<Real>(team, [&](Index leaf) {
      Real sum(0);
      for (Index cone = leaf; cone < cones; cone += kReduceLeaves)
        with_shape(env->kind[cone], env->cone_size(cone),
                   [&](auto shape) { sum = sum + f(shape, cone, env->cone_row(cone)); });
      return sum;
    });
  }
};

/// A system as those see it that need rows and cones of it, and not its matrix. Forms in the batch's order have these
/// in common.
template <class System>
STICTION_HD auto& without_matrix(System& s) {
  if constexpr (requires { s.env->kind; }) {
    return static_cast<FileOrderSystem<typename System::Real>&>(s);
  } else {
    return s;
  }
}

}  // namespace stiction::inline STICTION_ISA
