#pragma once

#include <type_traits>

#include "core/algorithm/velocity/lanes/lane_env.hpp"
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
/// True if environments that are too large for a lane are taken part by part. A change of J or M may couple parts.
template <class Job, class Real>
inline constexpr bool kTakesParts = std::is_same_v<Job, JacobianVjpJob<Real>>;

/// True if an environment, or a part of one, of that size is taken. One of more than kMostVelocityDofs is a lane alone.
template <class Real>
STICTION_HD bool takes_derivative_size(const LaneEnv<Real>& env) {
  return env.dofs > 0 && env.dofs <= kMostLargeDofs && env.rows <= kMostVelocityRows;
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
STICTION_HD void join(JacobianVjpResult& whole, const JacobianVjpResult& part) {
  whole.square = max_(part.square, whole.square);
  whole.forward_residual = max_(part.forward_residual, whole.forward_residual);
  whole.unknowns += part.unknowns;
  whole.degenerate += part.degenerate;
  whole.is_answered = whole.is_answered && part.is_answered;
}

/// Writes down whether an environment is answered, and its record if it is.
template <class Job>
STICTION_HD void finish(const Job& job, std::uint8_t* answered, Offset env, const JacobianVjpResult& found) {
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
