#pragma once

#include "core/algorithm/velocity/lanes/slots.hpp"

/// J'GJ in the envelope of a tree, G being the slopes of cones (docs/math/velocity_newton.md).
namespace stiction::inline STICTION_ISA {

/// visit_slot() of all slots, one after the other.
template <class SlotT, class F, class G>
STICTION_HD void visit_slots(const SlotT* slots, const SlotCounts& counts, F&& f, G&& g) {
  for (Index s = 0; s < counts.slots; ++s) visit_slot(slots, s, f, g);
}

/// Adds to terms.hessian(). terms.entry(i) is a number of J. terms.times_hessian_rows<kCone, kRows>(slot, number, from,
/// in, out) writes G in, for rows of a slot or for kRows slots of one row each. Such slots touch the same degrees of
/// freedom.
template <class Terms>
struct HessianRows {
  using Value = typename Terms::Value;
  const Terms& terms;

  /// Adds rows `from` and on of a slot, in the rows of kColumns degrees of freedom from column `first` on.
  template <bool kCone, int kRows, int kColumns, class SlotT>
  STICTION_HD void add_columns(const SlotT& slot, Index s, Index from, Index first) const {
    const auto& hessian = terms.hessian();
    const Offset begin = slot.entry + static_cast<Offset>(from) * slot.columns;
    Value out[kColumns][kRows];
    std::decay_t<decltype(hessian)> row[kColumns];
    for (int c = 0; c < kColumns; ++c) {
      Value in[kRows];
      for (int k = 0; k < kRows; ++k) in[k] = terms.entry(begin + static_cast<Offset>(k) * slot.columns + first + c);
      terms.template times_hessian_rows<kCone, kRows>(slot, s, from, in, out[c]);
      row[c] = hessian.from(terms.tree.begin[slot.dof[first + c]]);
    }
    const auto* const depth = slot.depth();
    const auto add = [&](int c, Index other, const Value(&entry)[kRows]) {
      const Index at = depth[other];
      Value sum = row[c][at];
      for (int k = 0; k < kRows; ++k) sum = fma_(out[c][k], entry[k], sum);
      row[c].put(at, sum);
    };
    for (Index other = 0; other < first + kColumns; ++other) {
      Value entry[kRows];
      for (int k = 0; k < kRows; ++k) entry[k] = terms.entry(begin + static_cast<Offset>(k) * slot.columns + other);
      for (int c = 0; c < kColumns; ++c)
        if (other <= first + c) add(c, other, entry);
    }
  }

  /// Adds rows `from` and on of a slot. Lanes of a team take a column each, and the same ones of every slot.
  template <bool kCone, int kRows, Team TeamT, class SlotT>
  STICTION_HD void add_slot(TeamT& team, const SlotT& slot, Index s, Index from) const {
    if constexpr (kIsAlone<TeamT>) {
      Index first = 0;
      for (; first + 2 <= slot.columns; first += 2) add_columns<kCone, kRows, 2>(slot, s, from, first);
      if (first < slot.columns) add_columns<kCone, kRows, 1>(slot, s, from, first);
    } else {
      share(team, slot.columns, [&](Index first) { add_columns<kCone, kRows, 1>(slot, s, from, first); });
    }
  }

  /// Adds all slots of one row. A pyramid's edges touch the same degrees of freedom, so that each entry of H is read
  /// once for several rows.
  STICTION_HD_OUTLINE void add_single_rows() const {
    auto&& team = terms.workspace.team();
    for_each_in_turn(team, terms.slots, terms.counts.singles, [&](auto& workers, Index s) -> Index {
      if constexpr (kIsAlone<decltype(workers)> && !kIsAlone<decltype(team)>) {
        add_columns<false, 1, 1>(terms.slots[s], s, 0, 0);
        return 1;
      } else {
        const Index run = run_of(terms.slots, s, terms.counts.singles);
        Index k = 0;
        for (; k + 4 <= run; k += 4) add_slot<false, 4>(workers, terms.slots[s], s, k);
        for (; k + 2 <= run; k += 2) add_slot<false, 2>(workers, terms.slots[s], s, k);
        if (k < run) add_slot<false, 1>(workers, terms.slots[s], s, k);
        return run;
      }
    });
  }

  STICTION_HD void add() const {
    add_single_rows();
    auto&& team = terms.workspace.team();
    for (Index s = terms.counts.singles; s < terms.counts.slots; ++s) {
      visit_slot(
          terms.slots, s, [](const auto&, Index) {},
          [&](auto shape, const auto& slot, Index) { add_slot<true, decltype(shape)::kRows>(team, slot, s, 0); });
      team.sync();
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
