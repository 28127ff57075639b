#pragma once

#include <cstdint>

#include "core/base/macros.hpp"
#include "core/job/jacobian_job.hpp"
#include "stiction/derivative.hpp"

namespace stiction {

/// Largest option max_unknowns: a square of doubles of 8 GiB.
inline constexpr Index kMostUnknowns = 32768;

/// Input of the derivatives of a batch, as plain data in the memory of the machine that computes them.
template <class Real>
struct DerivativeJob {
  ContactBatchView<Real> batch;
  ReactionView<Real> at;
  Law law;
  double residual_limit;
  double tie_tolerance;
  Index max_unknowns;
  Offset count;  ///< sets of cotangents or tangents
  GradientStatus* status;
};

/// Cotangents of the solution to cotangents of the batch.
template <class Real>
struct VjpJob : DerivativeJob<Real> {
  SolutionCotangentView<Real> cotangents;
  BatchCotangentView<Real> gradients;
};

/// Changes of the batch to changes of the solution.
template <class Real>
struct JvpJob : DerivativeJob<Real> {
  BatchTangentView<Real> tangents;
  SolutionTangentView<Real> changes;
};

/// Result of lanes for an environment, or a part of one, that they differentiate.
struct JacobianPackResult {
  double scale = 0.0;             ///< max|b| of the whole environment, where this is a part; 0: it is the whole  [w]
  double square = 0.0;            ///< of the adjoint's residual, the largest of all sets                         [-]
  double forward_residual = 0.0;  ///< relative to that scale                                                     [-]
  Index unknowns = 0;
  Index degenerate = 0;
  bool is_answered = true;
};

/// Results for environments that are pulled back side by side, before others are looked at one by one.
template <class Real>
struct JacobianVjpLanes {
  Real* adjoint = nullptr;           ///< a, (32) of docs/math/derivative.md  (count * dof_count)
  Real* moved = nullptr;             ///< M^-1 J' lambda                      (dof_count)
  std::uint8_t* answered = nullptr;  ///< 1: all but cotangents of J and M is written; null: none is  (env_count)
};

/// Cotangents of a solution to those of J, M and v_free, through the contact batch that is assembled of them.
template <class Real>
struct JacobianVjpJob {
  VjpJob<Real> contact;             ///< of the assembled batch: from `seed` to `nu`
  JacobianBatchJob<Real> assembly;  ///< how it is assembled, laid out already
  JacobianSolutionCotangentView<Real> cotangents;
  JacobianBatchCotangentView<Real> gradients;
  Real* seed;  ///< by the reactions, with the terms of velocities that depend on them  (count * row_count)
  Real* nu;    ///< by b                                                   (count * row_count)
  JacobianVjpLanes<Real> lanes;
  bool has_jacobian = true;  ///< else there is nothing to assemble, and `contact` is all

  [[nodiscard]] STICTION_HD bool is_answered(Offset env) const {
    return lanes.answered != nullptr && lanes.answered[env] != 0;
  }

  /// Connects the parts: an assembly that is laid out, and memory for seed and nu.
  void connect(const JacobianBatchJob<Real>& laid_out, Real* seeds, Real* nus) {
    assembly = laid_out;
    contact.batch = contact_view(assembly.batch, assembly.to);
    contact.cotangents.lambda = seed = seeds;
    contact.gradients.b = nu = nus;
  }
};

/// Changes of J, M and v_free to those of the solution, through the contact batch that is assembled of them.
template <class Real>
struct JacobianJvpJob {
  JvpJob<Real> contact;             ///< of the assembled batch, whose b changes by `motion`
  JacobianBatchJob<Real> assembly;  ///< how it is assembled, laid out already
  JacobianBatchTangentView<Real> tangents;
  JacobianSolutionTangentView<Real> changes;
  Real* motion;              ///< change of the motion while reactions rest               (count * row_count)
  Real* reaction;            ///< change of the reactions                                 (count * row_count)
  bool has_jacobian = true;  ///< else there is nothing to assemble, and `contact` is all

  /// Connects the parts: an assembly that is laid out, and memory for motion and reaction.
  void connect(const JacobianBatchJob<Real>& laid_out, Real* motions, Real* reactions) {
    assembly = laid_out;
    contact.batch = contact_view(assembly.batch, assembly.to);
    contact.tangents.b = motion = motions;
    contact.changes.lambda = reaction = reactions;
  }
};

}  // namespace stiction
