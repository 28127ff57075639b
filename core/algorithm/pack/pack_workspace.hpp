#pragma once

#include "core/algorithm/system/dense_system.hpp"
#include "core/base/pack.hpp"
#include "core/base/transpose.hpp"

namespace stiction::inline STICTION_ISA {

/// Rows whose motion is found together: so many zeros are behind an environment's reactions.
inline constexpr Index kFourRows = 4;

/// Neighbouring columns of the lanes that are neighbours in every matrix that is dealt out.
struct ColumnTile {
  Index first;
  Index count;
};

/// Memory of a pack of W environments beside its system. `Lanes` arrays hold a number of each lane side by side.
template <class Real, int W>
struct PackWorkspace {
  using Lanes = Pack<Real, W>;
  static constexpr Index kLanes = W;
  static_assert(W % kTileEdge<Real> == 0);
  /// No tile is wider: how far behind a row's last number one may reach.
  static constexpr Index kLine = 64 / static_cast<Index>(sizeof(Real));

  // Each lane's environment, as long as it is there.
  Index* batch_row;    ///< the environment's row in each of a lane's, -1: none    (W; n)
  Lanes* scale;        ///< factor of that row, 0: there is none                   (n)
  Lanes* lo;           ///< bounds of box cones in the batch's units               (cones)
  Lanes* hi;           ///<                                                        (cones)
  Lanes* share;        ///< of each cone's island, as in SystemArrays::shares      (cones)
  double* press;       ///< ConeMetric, in double: a of each cone                  (cones; W)
  double* axis_press;  ///< and its weights of rows                                (n; W)
  double* axis_slip;   ///<                                                        (n; W)
  // While environments enter.
  Lanes* compliance;  ///< R in the batch's units                                (n)
  Lanes* entry;       ///< diagonal of A there, 0 where a row has a column twice (n)
  Lanes* diagonal;    ///< of A + diag R there                                   (n)
  Lanes* present;     ///< 1: the environment has such a row, 0: it does not     (n)
  Lanes* factor;      ///< factors of rows and columns of its matrix             (n)
  ColumnTile* tile;   ///<                                                       (n at most)
  Index* column;      ///< where in a lane's matrix each tile begins; before that, where each of its rows goes  (n; W)
  const Real** row;   ///< of each lane's matrix                                 (n; W)
  Real* written;      ///< matrices that cannot be read where they are stored    (W; n * n)
  Real* tail;         ///< last rows of those that can, with room behind them    (W; tail_length)
  Real* zeros;        ///< a row that no environment has                         (n + kLine)
  // While answers are judged.
  Lanes* lambda;   ///< reactions in the batch's units                           (n)
  double* motion;  ///< (A + diag R) lambda + b                                  (n; W)
  double* wide;    ///< reactions of one lane in the batch's order, then zeros  (n + 4)
  double* moved;   ///< their motion                                             (n)
  Index n;
  Index tail_length;

  static constexpr Offset elements(Offset n, Offset cones) {
    return W * (n * n + (11 + 5 * kDouble) * n + (3 + kDouble) * cones + tail_of(n) + kLine + kFourRows * kDouble);
  }

  PackWorkspace(Real* memory, Index rows, Index cones) : n(rows), tail_length(static_cast<Index>(tail_of(rows))) {
    const auto take = [&memory](Offset count) {
      Real* const part = memory;
      memory += count * W;
      return part;
    };
    for (Lanes** part : {&scale, &compliance, &entry, &diagonal, &present, &factor, &lambda})
      *part = reinterpret_cast<Lanes*>(take(n));
    for (Lanes** part : {&lo, &hi, &share}) *part = reinterpret_cast<Lanes*>(take(cones));
    press = reinterpret_cast<double*>(take(kDouble * cones));
    for (double** part : {&axis_press, &axis_slip}) *part = reinterpret_cast<double*>(take(kDouble * n));
    motion = reinterpret_cast<double*>(take(kDouble * n));
    row = reinterpret_cast<const Real**>(take(kDouble * n));
    wide = reinterpret_cast<double*>(take(kDouble * (n + kFourRows)));
    moved = wide + n + kFourRows;  // W times the need of one
    batch_row = reinterpret_cast<Index*>(take(n));
    column = reinterpret_cast<Index*>(take(n));
    tile = reinterpret_cast<ColumnTile*>(take(n));
    written = take(Offset{n} * n);
    tail = take(tail_length);
    zeros = take(n + kLine);
  }

  [[nodiscard]] Index* rows_of(int lane) const { return batch_row + Offset{n} * lane; }
  /// One lane of an array of Lanes.
  [[nodiscard]] static Strided<Real, W> lane_of(Lanes* lanes, int lane) {
    return {reinterpret_cast<Real*>(lanes) + lane};
  }

  static_assert(sizeof(Index) <= sizeof(Real) && sizeof(const Real*) <= sizeof(double) &&
                sizeof(ColumnTile) <= W * sizeof(Real));

 private:
  static constexpr Offset kDouble = sizeof(double) / sizeof(Real);
  static constexpr Offset tail_of(Offset n) { return n + 2 * kLine; }
};

/// Neighbouring numbers as doubles.
template <int W>
void widen_lanes(const double* from, Pack<double, W>& to) {
  load_lanes(from, to);
}
template <int W>
void widen_lanes(const float* from, Pack<double, W>& to) {
  to.v = __builtin_convertvector(*reinterpret_cast<const typename VectorOf<float, W>::Anywhere*>(from),
                                 typename VectorOf<double, W>::Type);
}
/// Number of doubles that fit the vector of W Reals.
template <class Real, int W>
inline constexpr int kWideLanes = W * static_cast<int>(sizeof(Real)) / static_cast<int>(sizeof(double));
/// Widens lanes from `first` on.
template <class Real, int W>
Pack<double, kWideLanes<Real, W>> widened(const Pack<Real, W>& lanes, int first) {
  Pack<double, kWideLanes<Real, W>> values;
  widen_lanes(reinterpret_cast<const Real*>(&lanes) + first, values);
  return values;
}

}  // namespace stiction::inline STICTION_ISA
