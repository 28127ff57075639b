#pragma once

#include "core/algorithm/derivative/mode_products.hpp"
#include "core/algorithm/pack/lane_rows.hpp"

namespace stiction::inline STICTION_ISA {

/// Scratch of W environments that are differentiated side by side. Numbers of all lanes lie beside each other, by the
/// rows of ModeSlots; results of each environment alone lie apart.
template <class Real, int W>
struct ModeWorkspace {
  using Lanes = Pack<double, W>;
  static constexpr Index kLanes = W;
  static constexpr Index kLine =
      kTileEdge<Real>;  ///< how far behind a row's last number a tile may reach, and one more

  Real* A;              ///< A as the batch has it, 0 where a lane has no such row      (n * n; W)
  Lanes* E;             ///< how reactions follow the unknowns                          (n * kMaxConeRows)
  Lanes* F;             ///< which motions stay zero                                    (n * kMaxConeRows)
  Lanes* D;             ///< 1 where a lane has no such unknown                         (n)
  Lanes* R;             ///<                                                            (n)
  Lanes* seed;          ///< reactions, then their cotangents, or changes of w          (n)
  Lanes* still;         ///< their motion, then its cotangents, or changes while reactions rest  (n)
  Lanes* nu;            ///< adjoint reaction, or change of the reaction                (n)
  Lanes* image;         ///< product with A', or changes of tests                       (n)
  Lanes* K;             ///< the systems                                                (n * n)
  Lanes* row_scale;     ///< powers of two                                              (n)
  Lanes* column_scale;  ///<                                                            (n)
  Lanes* unknown;       ///<                                                            (n)
  double* own;          ///< of each environment, as DerivativeScratch without a system (W; own_length)
  const Real** row;     ///< of each lane's matrix                                      (n; W)
  Real* tail;           ///< last rows of matrices, with room behind them               (W; tail_length)
  Real* zeros;          ///< a row that no environment has                              (n + kLine)
  ColumnTile* tile;     ///< columns that are dealt out together                        (n at most)
  ConeUnknowns* cone;   ///< of all lanes, with the unknowns that some lane has         (n at most)
  Index* cone_of_row;   ///<                                                            (n)
  Index* pivots;        ///<                                                            (n; W)
  Index* batch_row;     ///< the environment's row in each row here, -1: none           (W; n)
  Index* cone_row;      ///< first row here of each environment's cones                 (W; cones)
  Index n;
  Index cones;
  Index tail_length;
  Offset own_length;

  static constexpr Offset lane_elements(Offset n, Offset cones) { return derivative_elements(n, cones, 0, 0); }
  /// Doubles that a workspace takes.
  static constexpr Offset elements(Offset n, Offset cones) {
    return W * (2 * n * n + (11 + 2 * kMaxConeRows) * n + lane_elements(n, cones) + tail_of(n)) + n + kLine +
           (2 * n + integers(n, cones) + 1) / 2;
  }

  ModeWorkspace(double* memory, Index rows, Index most_cones)
      : n(rows),
        cones(most_cones),
        tail_length(static_cast<Index>(tail_of(rows))),
        own_length(lane_elements(rows, most_cones)) {
    const auto take = [&memory](Offset count) {
      double* const part = memory;
      memory += count;
      return part;
    };
    const auto take_lanes = [&](Offset count) { return reinterpret_cast<Lanes*>(take(W * count)); };
    K = take_lanes(Offset{n} * n);
    A = reinterpret_cast<Real*>(take(Offset{n} * n * W));
    E = take_lanes(n * kMaxConeRows);
    F = take_lanes(n * kMaxConeRows);
    for (Lanes** part : {&D, &R, &seed, &still, &nu, &image, &row_scale, &column_scale, &unknown})
      *part = take_lanes(n);
    own = take(W * own_length);
    row = reinterpret_cast<const Real**>(take(Offset{n} * W));
    tail = reinterpret_cast<Real*>(take(Offset{tail_length} * W));
    zeros = reinterpret_cast<Real*>(take(n + kLine));
    tile = reinterpret_cast<ColumnTile*>(take(n));
    cone = reinterpret_cast<ConeUnknowns*>(memory);
    cone_of_row = reinterpret_cast<Index*>(cone + n);
    pivots = cone_of_row + n;
    batch_row = pivots + W * n;
    cone_row = batch_row + W * n;
  }

  [[nodiscard]] Index* rows_of(int lane) const { return batch_row + Offset{n} * lane; }
  [[nodiscard]] Index* cones_of(int lane) const { return cone_row + Offset{cones} * lane; }

  static_assert(sizeof(ColumnTile) <= sizeof(double) && sizeof(const Real*) <= sizeof(double));
  static_assert(sizeof(ConeUnknowns) == 4 * sizeof(Index));

 private:
  static constexpr Offset integers(Offset n, Offset cones) { return (2 * W + 5) * n + W * cones; }
  static constexpr Offset tail_of(Offset n) { return n + 2 * kLine; }
};

}  // namespace stiction::inline STICTION_ISA
