#pragma once

#include "core/body/direct/dense_product.hpp"
#include "core/body/direct/fill_matrix.hpp"

namespace stiction::inline STICTION_ISA {

/// What both branches of Newton's method keep in doubles. The first vectors mean the same in both; the others belong to
/// one branch, of which an environment takes only one.
enum NewtonVector : Index {
  kCompliance = 0,  ///< R, in the solver's coordinates
  kPoint,           ///< zeta; proximal: x
  kMotion,          ///< u = A zeta + b; proximal: y = (A + R) x + b
  kGap,             ///< zeta - x(u); proximal: what the natural map is off by
  kStep,            ///< Newton's direction d
  kImage,           ///< A d; proximal: (A + R) d
  kOfCone,          ///< by cone: what a sum over cones is made of
  kOfConeToo,       ///< the same
  kZones,           ///< by cone: ConeZone at the last factorisation
  kUnknown,         ///< right-hand side and solution of the factored system
  kFactor,          ///< C, six columns: entry (k, j) of the cone at row r at 6 (r + k) + j
  kNewtonVectors = kFactor + 6,
  kCentre = kZones,            ///< proximal: the point that the proximal term pulls to
  kPivots = kFactor,           ///< proximal: exchanged rows
  kTrial = kFactor + 1,        ///< proximal: the point tried
  kTrialMotion = kFactor + 2,  ///< proximal: its motion
};

inline constexpr Index kNewtonMatrices = 2;

/// The vectors and matrices of one environment.
struct NewtonRoom {
  double* first;
  Index n;

  [[nodiscard]] STICTION_HD double* vector(Index k) const { return first + Offset{k} * n; }
  [[nodiscard]] STICTION_HD DenseMatrix matrix(Index k) const {
    return {first + Offset{kNewtonVectors} * n + Offset{k} * n * n, n};
  }
};
template <class System>
STICTION_HD NewtonRoom newton_room(const System& s) {
  return {s.wide, s.n};
}

/// A cone's rows of a vector.
template <int M, class Vector>
STICTION_HD void read_cone(const Vector& from, Index row, double (&to)[M]) {
  for (int k = 0; k < M; ++k) to[k] = static_cast<double>(from[row + k]);
}

/// Matrix 0 times one vector, plus b, into another.
template <Block B, class System>
STICTION_HD_OUTLINE void renew_motion(B& block, const System& s, Index point, Index motion) {
  const NewtonRoom room = newton_room(s);
  double* const y = room.vector(motion);
  multiply_dense(
      block, room.matrix(0), room.vector(point), [&](Index i) { return static_cast<double>(s.b[i]); },
      [&](Index i, double value) { y[i] = value; });
}

}  // namespace stiction::inline STICTION_ISA
