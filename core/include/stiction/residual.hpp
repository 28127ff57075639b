#pragma once

/// \file
/// How good given reactions are, by code that the solvers do not share.

#include <cmath>
#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// Errors of the contacts of an environment (docs/math/residual.md).
struct Residual {
  double relative;  ///< largest error of a contact / scale of its island [-]
  double absolute;  ///< largest error of a contact [w]
  double scale;     ///< scale of the island of the contact with the largest relative error, 0: none has an error [w]
  Index cone;       ///< that contact, counted within the environment, -1: none has an error
};

/// Error of the contact with the largest relative error [w].
inline double worst_error(const Residual& residual) {
  const bool divides = residual.scale > 0 && std::isfinite(residual.scale) && std::isfinite(residual.relative);
  return divides ? residual.relative * residual.scale : residual.absolute;
}

/// Computes the error of given reactions, one residual per environment. It is written from the definition in
/// docs/math/residual.md and shares no code with the solvers. `stiction verify` prints it.
/// \throws Error(invalid_argument) if lambda's length is not the batch's row count.
template <class Real>
std::vector<Residual> verify(const ContactBatchView<Real>& batch, std::span<const Real> lambda);

}  // namespace stiction
