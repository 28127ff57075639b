#pragma once

#include "core/algorithm/sweep/local_solve.hpp"
#include "core/algorithm/system/sparse_system.hpp"
#include "core/job/cone_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// Cones while a sweep solves them together, approximately (docs/math/pgs.md, "Blocks of cones"). Motion is gathered
/// once. Changes of the block's own are pushed onto it, by the block's own entries of A alone. Cones that are
/// neighbours in the environment form a run, and a row's entries of a run lie together.
template <class Real>
class ConeBlock {
 public:
  /// The cones at positions [first, end) of the plan's order, by their numbers.
  STICTION_HD ConeBlock(const SparseSystem<Real>& s, Index first, Index end) : s_(s) {
    const EnvView<Real>& env = *s.env;
    for (Index p = first; p < end; ++p) {
      const Index cone = env.cone_order[p];
      const Index row = env.cone_row(cone), size = env.cone_size(cone);
      if (rows_ + size > kMostBlockRows) return;
      if (p == first || row != row_[rows_ - 1] + 1) run_begin_[runs_++] = rows_;
      for (Index k = 0; k < size; ++k) row_[rows_++] = row + k;
    }
    run_begin_[runs_] = rows_;
    is_whole_ = true;
    for (Index run = 0; run < runs_; ++run) {
      Index place = 0;
      for (Index r = 0; r < rows_ && is_whole_; ++r) {
        place = find(row_[r], run, place);
        is_whole_ = place >= 0;
        if (is_whole_) own_[r][run] = s.value.data + (env.row_offsets[row_[r]] - env.row_offsets[0]) + place;
      }
    }
  }

  /// Returns true if it has room and each row stores all of the block, column after column of each run. Else there is
  /// no block: its cones are visited one by one.
  [[nodiscard]] STICTION_HD bool is_whole() const { return is_whole_; }

  STICTION_HD void gather() {
    for (Index r = 0; r < rows_; ++r) {
      const Index row = row_[r];
      start_[r] = s_.x[row];
      y_[r] = s_.gather(row, s_.x, fma_(s_.R[row], s_.x[row], s_.b[row]));
    }
  }

  /// The number of runs that end at row r of the block, or before it.
  [[nodiscard]] STICTION_HD Index run_of(Index r, Index perhaps) const {
    while (r >= run_begin_[perhaps + 1]) ++perhaps;
    return perhaps;
  }
  [[nodiscard]] STICTION_HD Real motion(Index r) const { return y_[r]; }
  /// The block's change of row r of x.
  [[nodiscard]] STICTION_HD Real change(Index r) const { return s_.x[row_[r]] - start_[r]; }

  /// Pushes the change of a cone's rows, from row `first` of the block on, which are of that run.
  template <int M>
  STICTION_HD void push(Index first, Index run, const Real (&d)[M]) {
    for (int k = 0; k < M; ++k) y_[first + k] = fma_(s_.R[row_[first + k]], d[k], y_[first + k]);
    const Index begin = first - run_begin_[run];
    for (Index r = 0; r < rows_; ++r)
      for (int k = 0; k < M; ++k) y_[r] = fma_(own_[r][run][begin + k], d[k], y_[r]);
  }

 private:
  /// The place at which a row's entries of a run begin, perhaps that of the row before; -1 if some are elsewhere.
  [[nodiscard]] STICTION_HD Index find(Index row, Index run, Index perhaps) const {
    const Index* const column = s_.env->columns(row);
    const Index first = row_[run_begin_[run]], count = run_begin_[run + 1] - run_begin_[run];
    const Index last = s_.env->entries(row) - count;
    Index place = perhaps <= last ? perhaps : 0;
    if (last >= 0 && column[place] != first)
      for (place = 0; place <= last && column[place] != first;) ++place;
    if (place > last) return -1;
    for (Index c = 0; c < count; ++c)
      if (column[place + c] != first + c) return -1;
    return place;
  }

  const SparseSystem<Real>& s_;
  Index rows_ = 0, runs_ = 0;
  bool is_whole_ = false;
  Index row_[kMostBlockRows];            ///< the environment's row of each of the block's
  Index run_begin_[kMostBlockRows + 1];  ///< the block's row at which each run begins, closed by their number
  const Real* own_[kMostBlockRows][kMostBlockRows];  ///< entries of each row in each run
  Real start_[kMostBlockRows], y_[kMostBlockRows];
};

/// Visits the cones at positions [first, end), one vertex, as a block: several times before the sweep goes on. Returns
/// false if they are none. Else `largest` gets the size of their changes, if that is larger.
template <Law kLaw, class Local, class Real>
STICTION_HD_OUTLINE bool visit_block(SparseSystem<Real>& s, Index first, Index end, Real omega, Real& largest) {
  const EnvView<Real>& env = *s.env;
  ConeBlock<Real> block(s, first, end);
  if (!block.is_whole()) return false;
  block.gather();
  for (Index visit = 1; visit <= env.block_visits; ++visit) {
    Index begin = 0, run = 0;
    for (Index p = first; p < end; ++p) {
      const Index cone = env.cone_order[p];
      const Index row = env.cone_row(cone);
      run = block.run_of(begin, run);
      with_shape(env.kind[cone], env.cone_size(cone), [&](auto shape) {
        constexpr int kRows = decltype(shape)::kRows;
        Real y[kRows];
        for (int r = 0; r < kRows; ++r) y[r] = block.motion(begin + r);
        const auto step = Local::template of<kLaw>(shape, s, cone, row, y, omega);
        for (int r = 0; r < kRows; ++r) s.x[row + r] = s.x[row + r] + step.d[r];
        block.push(begin, run, step.d);
        begin += kRows;
        if (visit < env.block_visits) return;
        Real moved(0);
        for (int r = 0; r < kRows; ++r) moved = max_(abs_(block.change(begin - kRows + r)), moved);
        largest = max_(moved * s.residual_weight[cone], largest);
      });
    }
  }
  return true;
}

}  // namespace stiction::inline STICTION_ISA
