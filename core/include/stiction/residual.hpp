#pragma once

/// \file
/// How good given reactions are, by code that the solvers do not share.

#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// How far an answer is from one that solves its environment (docs/math/residual.md).
struct Residual {
  double relative;  ///< largest cone residual / max|b| [-]
  double absolute;  ///< largest cone residual [w]
};

/// Computes the natural-map residual of a given lambda in f64, one per environment. It is written from the definition
/// in docs/math/residual.md and shares no code with the solvers. `stiction verify` prints it.
/// \throws Error(invalid_argument) if lambda's length is not the batch's row count.
template <class Real>
std::vector<Residual> verify(const ContactBatchView<Real>& batch, std::span<const Real> lambda);

}  // namespace stiction
