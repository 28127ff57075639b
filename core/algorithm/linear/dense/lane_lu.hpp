#pragma once

#include "core/base/pack.hpp"
#include "core/team/team.hpp"

/// General square matrices of doubles side by side, one in each lane of a pack. Each lane does the work of factor_lu()
/// and solve_lu() of dense_lu.hpp for one matrix, number by number, and has their bits. Host only.
namespace stiction::inline STICTION_ISA {

/// W matrices that share their place, entry (i, j) of each beside those of the others. A smaller one is filled up with
/// rows and columns of the identity, which take part in nothing.
template <int W>
struct LaneMatrix {
  using Lanes = Pack<double, W>;
  Lanes* data;
  Index n;
  [[nodiscard]] Lanes& operator()(Index i, Index j) const { return data[Offset{j} * n + i]; }
  /// One lane's entry.
  [[nodiscard]] double& at(Index i, Index j, int lane) const {
    return reinterpret_cast<double*>(data)[(Offset{j} * n + i) * W + lane];
  }
};

/// unit_scale(), lane by lane.
template <int W>
Pack<double, W> unit_scale(Pack<double, W> numbers) {
  for (int lane = 0; lane < W; ++lane) numbers.v[lane] = unit_scale(numbers.v[lane]);
  return numbers;
}

/// Exchanges, in each lane, number j of a column with the one that was exchanged with it in the matrix.
template <int W>
void exchange_lanes(Pack<double, W>* column, Index j, const Index* pivots) {
  auto* const number = reinterpret_cast<double*>(column);
  for (int lane = 0; lane < W; ++lane) {
    if (pivots[lane] == j) continue;
    double &here = number[Offset{j} * W + lane], &there = number[Offset{pivots[lane]} * W + lane];
    const double kept = here;
    here = there;
    there = kept;
  }
}

/// Factors P K = L U, where each lane has a P of its own: row j changes places with row pivots[j * W + lane]. Column by
/// column, so that the one that changes stays in the first cache. Columns of L keep the order of when they were found,
/// so solve_lu() exchanges as it goes. Below the diagonal lies -L. Returns the lanes whose pivots were above
/// `floor` and finite. In others the factor is none.
template <int W>
Mask<Pack<double, W>> factor_lane_lu(const LaneMatrix<W>& K, Index* pivots, Pack<double, W> floor) {
  using Lanes = Pack<double, W>;
  const Index n = K.n;
  auto sound = not_(floor != floor);
  for (Index k = 0; k < n; ++k) {
    Lanes* const column = &K(0, k);
    for (Index j = 0; j < k; ++j) {
      exchange_lanes<W>(column, j, pivots + Offset{j} * W);
      const Lanes known = column[j];
      const Lanes* const L = &K(0, j);
      for (Index i = j + 1; i < n; ++i) column[i] = fma_(L[i], known, column[i]);
    }
    Lanes largest = abs_(column[k]);
    Lanes row(static_cast<double>(k));
    for (Index i = k + 1; i < n; ++i) {
      const Lanes size = abs_(column[i]);
      row = select(size > largest, Lanes(static_cast<double>(i)), row);
      largest = max_(size, largest);
    }
    sound = and_(sound, and_(largest > floor, finite_(largest)));
    for (int lane = 0; lane < W; ++lane) pivots[Offset{k} * W + lane] = static_cast<Index>(row.v[lane]);
    exchange_lanes<W>(column, k, pivots + Offset{k} * W);
    for (Index i = k + 1; i < n; ++i) column[i] = Lanes(0) - div_(column[i], column[k]);
  }
  return sound;
}

/// v = K^-1 v by the factors.
template <int W>
void solve_lu(SerialTeam&, const LaneMatrix<W>& K, const Index* pivots, Pack<double, W>* v) {
  using Lanes = Pack<double, W>;
  const Index n = K.n;
  for (Index j = 0; j < n; ++j) {
    exchange_lanes<W>(v, j, pivots + Offset{j} * W);
    const Lanes known = v[j];
    for (Index i = j + 1; i < n; ++i) v[i] = fma_(K(i, j), known, v[i]);
  }
  for (Index j = n - 1; j >= 0; --j) {
    const Lanes known = v[j] = div_(v[j], K(j, j));
    for (Index i = 0; i < j; ++i) v[i] = fma_(Lanes(0) - K(i, j), known, v[i]);
  }
}

}  // namespace stiction::inline STICTION_ISA
