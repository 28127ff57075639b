#pragma once

#include "core/algorithm/velocity/lanes/velocity_workspace.hpp"

/// The diagonal of A = J M^-1 J' of the environments in a pack's lanes.
namespace stiction::inline STICTION_ISA {

/// `View`: DoublePack, whose M is factored.
template <class View>
struct PackDiagonal {
  using Double = typename View::Double;
  using Doubles = typename View::Doubles;
  const View& pack;

  /// Lanes of a team take a row each. A pack takes three rows at once of slots that touch the same degrees of freedom.
  STICTION_HD void find() const {
    const Doubles x = pack.array(pack.workspace.rows_by_depth());
    const Index count = pack.counts.slots;
    if constexpr (!kIsAlone<decltype(pack.workspace.team())>) {
      const Doubles own = x.from(Offset{pack.workspace.lanes->rank()} * pack.tree.levels);
      pack.workspace.each(pack.counts.rows, [&](Index row) {
        Index s = row < pack.counts.singles ? row : pack.counts.singles;
        while (pack.slots[s].row + pack.slots[s].rows <= row) ++s;
        find_of<1>(pack.slots[s], row - pack.slots[s].row, own);
      });
    } else {
      for (Index s = 0; s < count;) {
        const auto& slot = pack.slots[s];
        s += run_of(pack.slots, s, count);
        const Index rows = pack.slots[s - 1].row + pack.slots[s - 1].rows - slot.row;
        Index k = 0;
        for (; k + 3 <= rows; k += 3) find_of<3>(slot, k, x);
        for (; k < rows; ++k) find_of<1>(slot, k, x);
      }
    }
  }

 private:
  /// Sums (L^-T j)^2 / D of kRows rows of a slot from row `from` on, each element in turn along the root path. `x` has
  /// room for them by depth.
  template <int kRows, class Slot>
  STICTION_HD void find_of(const Slot& slot, Index from, const Doubles& x) const {
    const auto& tree = pack.tree;
    const Index last = slot.columns == 0 ? 0 : slot.dof[slot.columns - 1];
    const auto* const path = tree.path(last);
    for (Index d = 0; d < kRows * (tree.depth[last] + 1); ++d) x.put(d, Double(0));
    for (int r = 0; r < kRows; ++r) {
      const Offset entry = slot.entry + static_cast<Offset>(from + r) * slot.columns;
      for (Index c = 0; c < slot.columns; ++c)
        x.put(kRows * slot.depth()[c] + r, pack.number(pack.workspace.J, entry + c));
    }
    Double sum[kRows];
    for (int r = 0; r < kRows; ++r) sum[r] = Double(0);
    Index depth = tree.depth[last];
    if constexpr (std::remove_cvref_t<decltype(tree)>::kIsWhole)
      for (; depth + 1 >= kTogether; depth -= kTogether) eliminate<kRows, kTogether>(path, depth, x, sum);
    for (; depth >= 0; --depth) eliminate<kRows, 1>(path, depth, x, sum);
    for (int r = 0; r < kRows; ++r) pack.array(pack.workspace.diagonal).put(slot.row + from + r, sum[r]);
  }

  /// Degrees of freedom that are eliminated in one pass over those above them.
  static constexpr int kTogether = 4;

  /// Takes the elements at `depth`, depth - 1, ..., so many of them, out of those above, and adds to the sums. Every
  /// element above is changed in that order.
  template <int kRows, int kMany, class Small>
  STICTION_HD void eliminate(const Small* path, Index depth, const Doubles& x, Double (&sum)[kRows]) const {
    const auto& tree = pack.tree;
    const Doubles L = pack.array(pack.workspace.factor), pivot = pack.array(pack.workspace.pivot);
    Doubles row[kMany];
    Double minus[kMany][kRows];
    bool is_any = kMany > 1;
    for (int i = 0; i < kMany; ++i) {
      const Index at = depth - i, dof = path[at];
      row[i] = L.from(tree.begin[dof]);
      for (int r = 0; r < kRows; ++r) {
        Double value = x[kRows * at + r];
        for (int below = 0; below < i; ++below) value = fma_(minus[below][r], row[below][at], value);
        sum[r] = fma_(value * value, pivot[dof], sum[r]);
        minus[i][r] = Double(0) - value;
        if constexpr (kMany == 1) is_any = is_any || any(value != Double(0));
      }
    }
    if (!is_any) return;
    for (Index d = tree.first(path[depth]); d <= depth - kMany; ++d) {
      Double entry[kMany];
      for (int i = 0; i < kMany; ++i) entry[i] = row[i][d];
      for (int r = 0; r < kRows; ++r) {
        Double value = x[kRows * d + r];
        for (int i = 0; i < kMany; ++i) value = fma_(minus[i][r], entry[i], value);
        x.put(kRows * d + r, value);
      }
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
