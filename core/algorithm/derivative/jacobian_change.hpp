#pragma once

#include "core/algorithm/derivative/jacobian_vjp_workspace.hpp"
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
  const JacobianVjpWorkspace<Types>& workspace;
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
      if (dJ == nullptr) continue;
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
    for (Index dof = 0; dof < env.dofs; ++dof) {
      const Index k = local_of(env, dof);
      const double none = free == nullptr ? 0.0 : static_cast<double>(free[dof]) * 0.0;
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
    for (Index i = 0; i < env.dofs; ++i) {
      const Index begin = i / env.block * env.block, own = local_of(env, i);
      const double half = -0.5 * moved(own);
      double sum = 0.0;
      for (Index j = begin; j < begin + env.block; ++j) {
        const Index k = local_of(env, j);
        const auto change = static_cast<double>(dM[Offset{i} * env.block + j - begin]);
        sum = fma_(change, moved(k), sum);
        of(workspace.scratch, k) = fma_(change, half, of(workspace.scratch, k));
      }
      of(workspace.scratch, own) = fma_(-0.5, sum, of(workspace.scratch, own));
    }
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
    for (Index i = 0; i < env.dofs; ++i) {
      const Index begin = i / env.block * env.block;
      for (Index j = begin; j <= i; ++j) f(local_of(env, i), local_of(env, j), Offset{i} * env.block + j - begin);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
