#pragma once

#include "core/algorithm/velocity/lanes/dof_islands.hpp"
#include "core/job/derivative_job.hpp"

/// Which environments of J and M lanes differentiate, whole or part by part (jacobian_pack.hpp).
namespace stiction::inline STICTION_ISA {

/// Returns true if an environment may be taken, as far as sizes and numbers do not decide. Its rows, J and M are known
/// to be sound.
template <class Job>
STICTION_HD bool takes_derivative(const Job& job, Offset env) {
  if ((job.assembly.to.flags[env] & kNotAssembled) != 0) return false;
  const bool is_solved = job.contact.at.status == nullptr || job.contact.at.status[env].code == EnvCode::solved;
  return job.contact.law == Law::convex && is_solved && takes_form(job.assembly.batch, env);
}
/// True if an environment, or a part of one, of that size is taken. One of more than kMostVelocityDofs is a lane alone.
template <class Real>
STICTION_HD bool takes_derivative_size(const LaneEnv<Real>& env) {
  return env.dofs > 0 && env.dofs <= kMostLargeDofs && env.rows <= kMostVelocityRows;
}

/// True if a degree of freedom of the environment is one of this part, or this is the whole.
template <class Real>
STICTION_HD bool has_dof(const LaneEnv<Real>& part, Index of_env) {
  if (part.dof == nullptr) return true;
  const Index k = local_of(part, of_env);
  return k < part.dofs && part.dof[k] == of_env;
}

/// True if a part can be differentiated without the others: cotangents couple no parts, but changes of J or M may.
template <class Real>
STICTION_HD bool stands_alone(const JacobianVjpJob<Real>&, const LaneEnv<Real>&) {
  return true;
}
template <class Real>
STICTION_HD bool stands_alone(const JacobianJvpJob<Real>& job, const LaneEnv<Real>& part) {
  const JacobianBatchView<Real>& batch = job.assembly.batch;
  bool stands = true;
  if (part.dofs == batch.env_dofs(part.env)) return stands;
  const auto look_at = [&](const Real* changes, Index count, auto&& dof_of_change) {
    for_each_nonzero(changes, count, [&](Index i) { stands = stands && has_dof(part, dof_of_change(i)); });
  };
  for (Offset set = 0; set < job.contact.count; ++set) {
    const Real* const dJ = job.tangents.J == nullptr ? nullptr : job.tangents.J + set * batch.entry_count;
    for (Index c = 0; dJ != nullptr && c < part.cones; ++c) {
      const Offset* const rows = batch.cone_row_offsets + part.first_cone + cone_of(part, c);
      for (Offset row = rows[0]; row < rows[1]; ++row) {
        const Offset first = batch.row_offsets[row];
        look_at(dJ + first, static_cast<Index>(batch.row_offsets[row + 1] - first),
                [&](Index i) { return batch.column == nullptr ? i : batch.column[first + i]; });
      }
    }
    if (job.tangents.M == nullptr) continue;
    const Real* const dM = job.tangents.M + set * batch.mass_count + batch.env_mass_offsets[part.env];
    for (Index k = 0; k < part.dofs; ++k) {
      const Index i = dof_of(part, k), first = i / part.block * part.block;
      look_at(dM + Offset{i} * part.block, batch.mass_form == MassForm::factor ? i + 1 - first : part.block,
              [&](Index j) { return first + j; });
    }
  }
  return stands;
}

/// True if a part of an environment is taken. The environment is if all of its parts are.
template <class Job, class Real>
STICTION_HD bool takes_part(const Job& job, const LaneEnv<Real>& part) {
  return takes_derivative_size(part) && stands_alone(job, part);
}

/// max|b| of an environment that is taken part by part, whose ties are measured by it.
template <class Real>
STICTION_HD double free_motion(const JacobianBatchView<Real>& batch, Offset env) {
  const Offset first = batch.env_row_offsets[env], rows = batch.env_rows(env);
  const Real* const v_free = batch.v_free + batch.env_dof_offsets[env];
  double largest = 0.0;
  for (Offset row = first; row < first + rows; ++row) {
    const Offset begin = batch.row_offsets[row], end = batch.row_offsets[row + 1];
    double sum = batch.target == nullptr ? 0.0 : 0.0 - static_cast<double>(batch.target[row]);
    for (Offset k = begin; k < end; ++k) {
      const Index dof = batch.column == nullptr ? static_cast<Index>(k - begin) : batch.column[k];
      sum = fma_(static_cast<double>(batch.J[k]), static_cast<double>(v_free[dof]), sum);
    }
    largest = max_(abs_(sum), largest);
  }
  return max_(largest, 1e-300);
}

/// Takes a part in.
STICTION_HD void join(JacobianPackResult& whole, const JacobianPackResult& part) {
  whole.square = max_(part.square, whole.square);
  whole.forward_residual = max_(part.forward_residual, whole.forward_residual);
  whole.unknowns += part.unknowns;
  whole.degenerate += part.degenerate;
  whole.is_answered = whole.is_answered && part.is_answered;
}

/// Writes down whether an environment is answered, and its record if it is.
template <class Job>
STICTION_HD void finish(const Job& job, std::uint8_t* answered, Offset env, const JacobianPackResult& found) {
  const bool is_answered = found.is_answered && found.unknowns <= job.contact.max_unknowns;
  answered[env] = is_answered ? 1 : 0;
  if (!is_answered) return;
  job.contact.status[env] = {sqrt_(found.square),
                             found.forward_residual,
                             found.degenerate > 0 ? static_cast<std::uint32_t>(kGradientSubgradient) : 0U,
                             found.unknowns,
                             found.degenerate,
                             0};
}

}  // namespace stiction::inline STICTION_ISA
