#pragma once

#include "core/algorithm/derivative/jacobian_pack_limits.hpp"
#include "core/algorithm/derivative/jacobian_pack_workspace.hpp"
#include "core/algorithm/derivative/vjp.hpp"
#include "core/algorithm/velocity/lanes/lane_env.hpp"

/// Changes of J, M and v_free of one environment in a lane, while its reactions rest (docs/math/derivative.md, (33a)).
namespace stiction::inline STICTION_ISA {

/// A set's changes. Between begin() and finish() scratch, adjoint and force have sums by degree of freedom.
template <class Types>
struct LaneChange {
  using Real = typename Types::Real;
  const JacobianJvpJob<Real>& job;
  const LaneEnv<Real>& env;
  const JacobianPackWorkspace<Types>& workspace;
  Offset set;
  int lane;

  /// Starts the sum of forces.
  STICTION_HD void begin() const {
    for (Index k = 0; k < env.dofs; ++k) of(workspace.scratch, k) = 0.0;
  }

  /// dJ v+ + J dv_free - dtarget + dR lambda of a row, whose dJ' lambda is added to the forces. `at`: its place in
  /// arrays by set and row.
  STICTION_HD double motion_of_row(Index row, Offset at) const {
    const JacobianBatchView<Real>& batch = job.assembly.batch;
    const auto lambda = static_cast<double>(workspace.x.at(row, lane));
    const Offset of_batch = at - set * batch.row_count;
    const Offset begin = batch.row_offsets[of_batch], end = batch.row_offsets[of_batch + 1];
    const Real* const dJ = job.tangents.J == nullptr ? nullptr : job.tangents.J + set * batch.entry_count;
    const Real* const free = free_change();
    double changed = fma_(given(job.tangents.R, at), lambda, 0.0 - given(job.tangents.target, at));
    double carried = 0.0;
    for (Offset e = begin; e < end; ++e) {
      const Index dof = batch.column == nullptr ? static_cast<Index>(e - begin) : batch.column[e];
      if (free != nullptr) carried = fma_(static_cast<double>(batch.J[e]), static_cast<double>(free[dof]), carried);
      if (dJ == nullptr || !has_dof(env, dof)) continue;
      const auto change = static_cast<double>(dJ[e]);
      const Index k = local_of(env, dof);
      changed = fma_(change, of(workspace.velocity, k), changed);
      of(workspace.scratch, k) = fma_(change, lambda, of(workspace.scratch, k));
    }
    return changed + carried;
  }

  /// Takes dM p from the forces and writes them where the right-hand side is read. A change of v_free that is no number
  /// makes them none.
  STICTION_HD void finish() const {
    if (job.tangents.M != nullptr) take_mass_change();
    const Real* const free = free_change();
    for (Index k = 0; k < env.dofs; ++k) {
      const double none = free == nullptr ? 0.0 : static_cast<double>(free[dof_of(env, k)]) * 0.0;
      workspace.v_bar().at(k, lane) = static_cast<Real>(of(workspace.scratch, k) + none);
    }
  }

 private:
  [[nodiscard]] STICTION_HD double& of(double* numbers, Index k) const {
    return numbers[Offset{k} * Types::kStride + lane];
  }
  /// p = M^-1 J' lambda of a degree of freedom.
  [[nodiscard]] STICTION_HD double moved(Index k) const {
    return of(workspace.velocity, k) - static_cast<double>(workspace.v_free.at(k, lane));
  }
  /// Changes of v_free of this environment, or null.
  [[nodiscard]] STICTION_HD const Real* free_change() const {
    const JacobianBatchView<Real>& batch = job.assembly.batch;
    if (job.tangents.v_free == nullptr) return nullptr;
    return job.tangents.v_free + set * batch.dof_count + batch.env_dof_offsets[env.env];
  }

  /// forces -= dM p. The symmetric part of dM counts; with M = L L' it is dL L' + L dL'.
  STICTION_HD void take_mass_change() const {
    const JacobianBatchView<Real>& batch = job.assembly.batch;
    const Real* const dM = job.tangents.M + set * batch.mass_count + batch.env_mass_offsets[env.env];
    if (batch.mass_form == MassForm::factor) return take_factor_change(dM);
    for_each_block([&](Index first, Index last, Index begin) {
      for (Index i = first; i < last; ++i) {
        const Index own = number_of(i);
        const Real* const row = dM + Offset{dof_of(env, own)} * env.block;
        const double half = -0.5 * moved(own);
        double sum = 0.0;
        for (Index j = first; j < last; ++j) {
          const Index k = number_of(j);
          const auto change = static_cast<double>(row[dof_of(env, k) - begin]);
          sum = fma_(change, moved(k), sum);
          of(workspace.scratch, k) = fma_(change, half, of(workspace.scratch, k));
        }
        of(workspace.scratch, own) = fma_(-0.5, sum, of(workspace.scratch, own));
      }
    });
  }
  STICTION_HD void take_factor_change(const Real* dL) const {
    double *const pulled = workspace.adjoint, *const changed = workspace.force;  // L'p and dL'p
    for (Index k = 0; k < env.dofs; ++k) of(pulled, k) = of(changed, k) = 0.0;
    for_each_lower([&](Index i, Index j, Offset entry) {
      of(pulled, j) = fma_(static_cast<double>(env.M[entry]), moved(i), of(pulled, j));
      of(changed, j) = fma_(static_cast<double>(dL[entry]), moved(i), of(changed, j));
    });
    for_each_lower([&](Index i, Index j, Offset entry) {
      const double both =
          fma_(static_cast<double>(dL[entry]), of(pulled, j), static_cast<double>(env.M[entry]) * of(changed, j));
      of(workspace.scratch, i) = of(workspace.scratch, i) - both;
    });
  }
  /// f(number of the row, number of the column, entry) for every block's lower triangle.
  template <class F>
  STICTION_HD void for_each_lower(F&& f) const {
    for_each_block([&](Index first, Index last, Index begin) {
      for (Index i = first; i < last; ++i) {
        const Index own = number_of(i);
        const Offset row = Offset{dof_of(env, own)} * env.block - begin;
        for (Index j = first; j <= i; ++j) f(own, number_of(j), row + dof_of(env, number_of(j)));
      }
    });
  }
  /// f(first, last, first of the block) for the degrees of freedom of every block of M, in the environment's order.
  template <class F>
  STICTION_HD void for_each_block(F&& f) const {
    for (Index first = 0, last = 0; first < env.dofs; first = last) {
      const Index begin = dof_of(env, number_of(first)) / env.block * env.block;
      while (last < env.dofs && dof_of(env, number_of(last)) < begin + env.block) ++last;
      f(first, last, begin);
    }
  }
  /// The number here of the i-th in the environment's order.
  [[nodiscard]] STICTION_HD Index number_of(Index i) const { return env.is_reversed ? env.dofs - 1 - i : i; }
};

}  // namespace stiction::inline STICTION_ISA
