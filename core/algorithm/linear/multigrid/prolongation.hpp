#pragma once

#include "core/algorithm/linear/block/block_diagonal.hpp"
#include "core/algorithm/linear/block/block_product.hpp"
#include "core/job/multigrid_view.hpp"

/// Map from a coarse body's twist to its members' (docs/math/multigrid.md).
namespace stiction::inline STICTION_ISA {

/// Coordinates of a position.
inline constexpr Index kPosition = 3;

/// The twist of a body at d = (its position - the coarse body's) that moves rigidly with the coarse body. It has
/// velocity v + w x d and spin w, as a block [I, -[d]x; 0, I].
STICTION_HD void rigid_block(const double* position, const double* coarse, double (&T)[kBlockEntries]) {
  const double x = position[0] - coarse[0];
  const double y = position[1] - coarse[1];
  const double z = position[2] - coarse[2];
  for (Index i = 0; i < kBlockEntries; ++i) T[i] = i % (kBodyBlock + 1) == 0 ? 1.0 : 0.0;
  T[4] = z;
  T[5] = 0.0 - y;
  T[9] = 0.0 - z;
  T[11] = x;
  T[15] = y;
  T[16] = 0.0 - x;
}

/// Inputs of prolongations: a level, its matrix, and positions of its bodies and of the coarse ones.
struct RigidMotions {
  MultigridLevel level;
  BlockMatrix H;
  const double* position;  ///< (3 rows)
  const double* coarse;    ///< (3 coarse rows)
  const double* label;     ///< of smoothed ones: the coarse body that each moves with (attach_bodies.hpp)  (rows)

  STICTION_HD void block(Index body, Index aggregate, double (&T)[kBlockEntries]) const {
    rigid_block(position + static_cast<Offset>(body) * kPosition, coarse + static_cast<Offset>(aggregate) * kPosition,
                T);
  }
  /// The coarse body that `body` takes `other` to move with: other's, or its own where other has none that the
  /// prolongation knows in this row. It then feels no force from it, and rigid motions remain so.
  [[nodiscard]] STICTION_HD double seen(const BlockPattern& prolongation, Index body, Index other) const {
    const auto joined = static_cast<Index>(label[other]);
    const bool is_known = joined == level.aggregate[other] || find_block(prolongation, body, joined) >= 0;
    return is_known ? label[other] : label[body];
  }
};

/// Coarse bodies are where their roots are. Any place would do: it changes the coarse twists' coordinates alone.
template <Team TeamT>
STICTION_HD_OUTLINE void pose_coarse(TeamT& team, const MultigridLevel& level, const double* position, double* coarse) {
  for_each(team, level.prolongation.columns_total, [&](Index aggregate) {
    const double* const root = position + static_cast<Offset>(level.root[aggregate]) * kPosition;
    for (Index i = 0; i < kPosition; ++i) coarse[static_cast<Offset>(aggregate) * kPosition + i] = root[i];
  });
}

/// P = T, the rigid motions of the graph's aggregates.
template <Team TeamT>
STICTION_HD_OUTLINE void prolong_rigidly(TeamT& team, const RigidMotions& rigid, const BlockMatrix& P) {
  for_each(team, P.pattern.rows, [&](Index row) {
    for (Index k = P.pattern.offsets[row]; k < P.pattern.offsets[row + 1]; ++k) {
      double T[kBlockEntries];
      rigid.block(row, P.pattern.columns[k], T);
      for (Index i = 0; i < kBlockEntries; ++i) P.block(k)[i] = T[i];
    }
  });
}

/// P = (I - damping D^-1 H) T with D the diagonal blocks of H: rigid motions, and cheaper ones around the seams
/// between aggregates.
template <Team TeamT>
STICTION_HD_OUTLINE void prolong_smoothly(TeamT& team, const RigidMotions& rigid, const BlockDiagonal& D,
                                          double damping, const BlockMatrix& P) {
  const BlockMatrix& H = rigid.H;
  for_each(team, P.pattern.blocks(), [&](Index k) {
    const Index row = row_of_block(P.pattern, k);
    const Index column = P.pattern.columns[k];
    const auto wanted = static_cast<double>(column);
    double T[kBlockEntries];
    double force[kBlockEntries] = {};
    for (Index l = H.pattern.offsets[row]; l < H.pattern.offsets[row + 1]; ++l) {
      const Index body = H.pattern.columns[l];
      if (rigid.seen(P.pattern, row, body) != wanted) continue;
      rigid.block(body, column, T);
      add_block_product<false>(H.block(l), T, force);
    }
    const double own = rigid.label[row] == wanted ? 1.0 : 0.0;
    rigid.block(row, column, T);
    for (Index j = 0; j < kBodyBlock; ++j) {
      double correction[kBodyBlock];
      for (Index i = 0; i < kBodyBlock; ++i) correction[i] = force[i * kBodyBlock + j];
      D.solve(row, correction);
      for (Index i = 0; i < kBodyBlock; ++i)
        P.block(k)[i * kBodyBlock + j] = fma_(0.0 - damping, correction[i], own * T[i * kBodyBlock + j]);
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
