#pragma once

/// \file
/// Boxed friction, the law of Bullet, DART, ODE and PhysX: batches made of it and from it (docs/math/box_friction.md).

#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// The batch with every friction cone replaced by boxed friction of the same rows and mu. The numbers stay.
template <class Real>
ContactBatch<Real> with_box_friction(const ContactBatch<Real>& batch);

/// A batch whose boxed friction has been written as half lines, and the way back. A cone of m rows has 2 m - 1: its
/// normal reaction x_n, then p_k >= 0 for each further axis, then as many v_k >= 0,
///
///     lambda_k = p_k - mu_k x_n,   0 <= p_k  _|_  w_k + v_k >= 0,   0 <= v_k  _|_  2 mu_k x_n - p_k >= 0.
///
/// Its solutions are those of boxed friction. The matrix is not symmetric and zero on the diagonal of v: a problem for
/// lemke. All other cones stay as they are.
template <class Real>
struct ComplementarityBatch {
  ContactBatch<Real> batch;       ///< with half lines
  std::vector<Offset> first_row;  ///< first row of each cone of the original batch        (cones + 1)
};

/// Makes that batch. Computed in double, rounded once.
/// \throws Error(invalid_argument) for a broken structure or friction that is negative or not finite;
/// Error(unsupported) for environments that are stored as factors.
template <class Real>
ComplementarityBatch<Real> as_complementarity(const ContactBatch<Real>& batch);

/// Brings reactions of `made.batch` back to the rows of `original`, the batch that it was made of [lambda].
/// \throws Error(invalid_argument) if the lengths do not fit.
template <class Real>
std::vector<Real> reactions(const ComplementarityBatch<Real>& made, const ContactBatch<Real>& original,
                            std::span<const Real> z);

}  // namespace stiction
