#pragma once

#include "core/algorithm/velocity/lanes/lane_env.hpp"

namespace stiction::inline STICTION_ISA {

/// f(i) for all i < count with numbers[i] != 0.
template <class Real, class F>
STICTION_HD void for_each_nonzero(const Real* numbers, Index count, F&& f) {
  constexpr Index kWord = SetTraits<DofSet>::kMost;
  for (Index from = 0; from < count; from += kWord) {
    const Index rest = count - from;
    for_each_dof(nonzero_of(numbers + from, rest < kWord ? rest : kWord), [&](Index i) { f(from + i); });
  }
}

/// The parts of an environment that neither M nor a cone couples. Each is a separate problem, so that environments of
/// more degrees of freedom than a lane takes can be solved part by part. Examples are robots beside one another, or
/// stones.
template <class Real>
class DofIslands {
 public:
  /// Integers that an environment's lists take.
  static STICTION_HD constexpr Offset integers(Offset dofs, Offset cones) { return 5 * dofs + 2 + 2 * cones; }

  /// `memory`: integers(dofs, cones) of them, which the parts' lists are in.
  STICTION_HD DofIslands(const JacobianBatchView<Real>& batch, Offset env, Index* memory)
      : batch_(batch), whole_(lane_env(batch, env)) {
    const auto take = [&memory](Index size) {
      Index* const part = memory;
      memory += size;
      return part;
    };
    parent_ = take(whole_.dofs);
    local_ = take(whole_.dofs);
    dof_ = take(whole_.dofs);
    dof_begin_ = take(whole_.dofs + 1);
    cone_begin_ = take(whole_.dofs + 1);
    cone_ = take(whole_.cones);
    first_dof_ = take(whole_.cones);
  }

  /// Finds the parts. Their order is that of their first degrees of freedom.
  STICTION_HD_OUTLINE void find() {
    for (Index k = 0; k < whole_.dofs; ++k) parent_[k] = k;
    for (Index k = 0; k < whole_.dofs; ++k) join_mass(k);
    for (Index cone = 0; cone < whole_.cones; ++cone) first_dof_[cone] = join_cone(cone);
    list_dofs();
    list_cones();
  }

  [[nodiscard]] STICTION_HD Index count() const { return count_; }
  [[nodiscard]] STICTION_HD LaneEnv<Real> part(Index i) const {
    LaneEnv<Real> part = whole_;
    part.dofs = dof_begin_[i + 1] - dof_begin_[i];
    part.cones = cone_begin_[i + 1] - cone_begin_[i];
    part.dof = dof_ + dof_begin_[i];
    part.local = local_;
    part.cone = cone_ + cone_begin_[i];
    part.rows = 0;
    for (Index c = 0; c < part.cones; ++c) {
      const Offset* const begin = batch_.cone_row_offsets + whole_.first_cone + part.cone[c];
      part.rows += static_cast<Index>(begin[1] - begin[0]);
    }
    const Index first = lowest_dof(part), last = dof_of(part, part.is_reversed ? 0 : part.dofs - 1);
    part.is_consecutive = last - first + 1 == part.dofs;
    part.is_one_block = part.is_consecutive && first / part.block == last / part.block;
    return part;
  }

 private:
  /// The first of those that a degree of freedom is known to be coupled with.
  STICTION_HD Index root(Index k) const {
    while (parent_[k] != k) k = parent_[k] = parent_[parent_[k]];
    return k;
  }
  STICTION_HD void join(Index a, Index b) const {
    a = root(a);
    b = root(b);
    parent_[a < b ? b : a] = a < b ? a : b;
  }

  /// Joins the degrees of freedom that M couples with ones before them.
  STICTION_HD void join_mass(Index k) const {
    const Index begin = k / whole_.block * whole_.block;
    for_each_nonzero(whole_.M + static_cast<Offset>(k) * whole_.block, k - begin, [&](Index i) { join(k, begin + i); });
  }
  /// Joins the degrees of freedom that a cone's rows touch. The first of it, -1: nothing.
  STICTION_HD Index join_cone(Index cone) const {
    const Offset* const rows = batch_.cone_row_offsets + whole_.first_cone + cone;
    Index first = -1;
    const auto touch = [&](Index dof) {
      if (first >= 0) join(first, dof);
      if (first < 0) first = dof;
    };
    for (Offset row = rows[0]; row < rows[1]; ++row) {
      const Offset begin = batch_.row_offsets[row], end = batch_.row_offsets[row + 1];
      if (batch_.column == nullptr) for_each_nonzero(batch_.J + begin, whole_.dofs, touch);
      for (Offset k = begin; batch_.column != nullptr && k < end; ++k)
        if (batch_.J[k] != Real(0)) touch(batch_.column[k]);
    }
    return first;
  }

  STICTION_HD void list_dofs() {
    for (Index k = 0; k <= whole_.dofs; ++k) dof_begin_[k] = 0;
    // Roots come before their members: a root's number is known when it is asked for.
    for (Index k = 0; k < whole_.dofs; ++k) {
      const Index first = root(k);
      local_[k] = first == k ? count_++ : local_[first];
      ++dof_begin_[local_[k] + 1];
    }
    for (Index i = 0; i < count_; ++i) dof_begin_[i + 1] += dof_begin_[i];
    for (Index k = 0; k < whole_.dofs; ++k) parent_[k] = local_[k];
    for (Index i = 0; i < count_; ++i) cone_begin_[i] = dof_begin_[i];
    for (Index i = 0; i < whole_.dofs; ++i) {
      const Index k = whole_.is_reversed ? whole_.dofs - 1 - i : i, part = parent_[k];
      local_[k] = cone_begin_[part] - dof_begin_[part];
      dof_[cone_begin_[part]++] = k;
    }
  }
  /// Degrees of freedom that nothing touches belong to the first part.
  STICTION_HD void list_cones() {
    for (Index i = 0; i <= count_; ++i) cone_begin_[i] = 0;
    const auto part_of = [&](Index cone) { return first_dof_[cone] < 0 ? 0 : parent_[first_dof_[cone]]; };
    for (Index cone = 0; cone < whole_.cones; ++cone) ++cone_begin_[part_of(cone) + 1];
    for (Index i = 0; i < count_; ++i) cone_begin_[i + 1] += cone_begin_[i];
    // Back to front, so that the ends left in the list are the beginnings.
    for (Index cone = whole_.cones - 1; cone >= 0; --cone) {
      const Index part = part_of(cone);
      cone_[--cone_begin_[part + 1]] = cone;
    }
    for (Index i = 0; i < count_; ++i) cone_begin_[i] = cone_begin_[i + 1];
    cone_begin_[count_] = whole_.cones;
  }

  const JacobianBatchView<Real>& batch_;
  LaneEnv<Real> whole_;
  Index count_ = 0;
  Index* parent_;  ///< towards the root; later the part that a degree of freedom is in
  Index* local_;
  Index* dof_;
  Index* dof_begin_;
  Index* cone_begin_;
  Index* cone_;
  Index* first_dof_;
};

}  // namespace stiction::inline STICTION_ISA
