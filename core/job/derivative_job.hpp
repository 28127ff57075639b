#pragma once

#include "stiction/derivative.hpp"

namespace stiction {

/// Largest option max_unknowns: a square of doubles of 8 GiB.
inline constexpr Index kMostUnknowns = 32768;

/// What the derivatives of a batch need, as plain data in the memory of the machine that computes them.
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

/// Cotangents of a solution to those of J, M and v_free, before and after those of the assembled contact batch.
template <class Real>
struct JacobianVjpJob {
  JacobianBatchView<Real> batch;
  ReactionView<Real> at;
  Offset count;
  GradientStatus* status;
  JacobianSolutionCotangentView<Real> cotangents;
  JacobianBatchCotangentView<Real> gradients;
  Real* seed;  ///< by the reactions, with what velocities depend on them  (count * row_count)
  Real* nu;    ///< by b                                                   (count * row_count)
};

}  // namespace stiction
