#pragma once

/// \file
/// Friction pyramids in place of cones (docs/howto/pyramid.md).

#include <span>
#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// A batch whose friction cones have been replaced by inscribed pyramids, and the way back (docs/howto/pyramid.md).
/// Each reaction is a sum of edges of its contact's pyramid with non-negative factors f,
///
///     lambda = E f,   A' = E' (A + diag R) E,   b' = E' b,   f >= 0 complementary to w' = E' w >= 0,
///
/// so that f minimises over the pyramids the function that lambda under the convex law minimises over the cones. Free,
/// unilateral and box rows stay as they are, R included.
template <class Real>
struct PyramidBatch {
  ContactBatch<Real> batch;        ///< a row for each edge, a cone for each row; its law is convex
  std::vector<Offset> first_edge;  ///< first row of each cone of the original batch        (cones + 1)
  int sides = 0;                   ///< edges of a contact of three rows
};

/// Makes the batch with friction cones of 3 rows as pyramids of `sides` = 4, 8 or 16 edges. They are (1, mu_1 cos t_i,
/// mu_2 sin t_i), t_i = 2 pi i / sides. Cones of another number of rows have two edges, +mu and -mu, for each axis
/// after the first row. Axes with mu = 0 have none, and a cone with no other axis is the one edge (1, 0, ...). The law
/// of a pyramid is the convex one, whatever the batch's law is. A has an entry between two edges where the batch
/// stores one between their cones. Computed in double, rounded once.
/// \throws Error(invalid_argument) for other `sides`, a broken structure or friction that is negative or not finite;
/// Error(unsupported) for environments that are stored as factors.
template <class Real>
PyramidBatch<Real> linearise(const ContactBatch<Real>& batch, int sides);

/// Reactions and motions in the rows of the original batch.
template <class Real>
struct PyramidReactions {
  std::vector<Real> lambda;  ///< E f [lambda]                     (rows of the original)
  std::vector<Real> w;       ///< (A + diag R) lambda + b [w]      (rows of the original)
};

/// Brings a solution f of `pyramids.batch` back to the rows of `original`, the batch that was linearised.
/// \throws Error(invalid_argument) if the lengths do not fit.
template <class Real>
PyramidReactions<Real> reactions(const PyramidBatch<Real>& pyramids, const ContactBatch<Real>& original,
                                 std::span<const Real> f);

}  // namespace stiction
