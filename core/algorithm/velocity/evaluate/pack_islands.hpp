#pragma once

#include "core/algorithm/residual/final_residual.hpp"

/// Islands of the environments in a pack's lanes, as their errors see them (docs/math/residual.md).
namespace stiction::inline STICTION_ISA {

/// `View`: DoublePack.
template <class View>
struct PackIslands {
  using Double = typename View::Double;
  using Doubles = typename View::Doubles;
  const View& pack;

  /// Turns the cones' own error scales, which are in `share`, into shares of `most`, the largest. A scale spreads from
  /// cone to degree of freedom, along M, and to cones, until nothing changes.
  STICTION_HD_OUTLINE void weigh(Double most) const {
    const Doubles scale = pack.array(pack.workspace.share_of), reach = pack.array(pack.workspace.scratch);
    // Lanes that neither move nor can be moved wait for nothing: those without a cone in a slot, say.
    pack.workspace.each(pack.counts.slots, [&](Index s) {
      const auto waits =
          and_(pack.press_of(pack.slots[s]) > Double(0), or_(scale[s] > Double(0), is_moved(pack.slots[s])));
      scale.put(s, select(waits, scale[s], most));
    });
    pack.workspace.each(pack.tree.dofs, [&](Index k) { reach.put(k, Double(0)); });
    // Cones of the largest scale come first, from parent to child. Most often they reach all, and no pass follows.
    if (any(behind(scale, most))) spread(scale, reach, most, most, 1);
    while (any(behind(scale, most)) && spread(scale, reach, Double(0), most, pack.tree.dofs)) {
    }
    pack.workspace.sync();  // all have looked at the scales
    pack.workspace.each(pack.counts.slots, [&](Index s) {
      scale.put(s, select(most > Double(0), island_share(most, scale[s]), Double(1)));
    });
  }

 private:
  /// The lanes in which some cone's scale is not the largest.
  [[nodiscard]] STICTION_HD Mask<Double> behind(const Doubles& scale, Double most) const {
    auto found = Double(0) > Double(0);
    for (Index s = 0; s < pack.counts.slots; ++s) found = or_(found, scale[s] < most);
    return found;
  }

  /// The lanes in which a reaction moves any of a slot's rows.
  template <class Slot>
  [[nodiscard]] STICTION_HD Mask<Double> is_moved(const Slot& slot) const {
    const Doubles diagonal = pack.array(pack.workspace.diagonal);
    auto found = diagonal[slot.row] > Double(0);
    for (Index k = 1; k < slot.rows; ++k) found = or_(found, diagonal[slot.row + k] > Double(0));
    return found;
  }

  /// The lanes in which any of a slot's rows touches column c.
  template <class Slot>
  [[nodiscard]] STICTION_HD Mask<Double> touches(const Slot& slot, Index c) const {
    const auto entry = [&](Index k) {
      return pack.number(pack.workspace.J, slot.entry + static_cast<Offset>(k) * slot.columns + c) != Double(0);
    };
    auto found = entry(0);
    for (Index k = 1; k < slot.rows; ++k) found = or_(found, entry(k));
    return found;
  }

  /// One pass, from cones whose scale is `least` or more, over so many ancestors of each degree of freedom. Returns
  /// true if any scale has grown, of cones or of degrees of freedom along M.
  STICTION_HD bool spread(const Doubles& scale, const Doubles& reach, Double least, Double most,
                          Index ancestors) const {
    for (Index s = 0; s < pack.counts.slots; ++s) {
      const auto counts = scale[s] >= least;
      if (!any(counts)) continue;
      pack.workspace.each(pack.slots[s].columns, [&](Index c) {
        const Index dof = pack.slots[s].dof[c];
        const auto raises = and_(counts, touches(pack.slots[s], c));
        reach.put(dof, select(raises, max_(scale[s], reach[dof]), reach[dof]));
      });
    }
    auto grown = Double(0) > Double(0);
    pack.workspace.once([&] {
      for (Index k = pack.tree.dofs; k-- > 0;) spread_along_row(k, reach, ancestors, grown);
      for (Index k = 0; k < pack.tree.dofs; ++k) spread_along_row(k, reach, ancestors, grown);
    });
    pack.workspace.each(pack.counts.slots, [&](Index s) {
      const Double own = scale[s];
      Double found = own;
      for (Index c = 0; c < pack.slots[s].columns && any(found < most); ++c)
        found = select(touches(pack.slots[s], c), max_(reach[pack.slots[s].dof[c]], found), found);
      scale.put(s, found);
      grown = or_(grown, found > own);
    });
    return any(not_(pack.workspace.all(not_(grown))));
  }

  /// Along M's entries between k and its last ancestors, in either direction.
  STICTION_HD void spread_along_row(Index k, const Doubles& reach, Index ancestors, Mask<Double>& grown) const {
    const auto* const path = pack.tree.path(k);
    const Index depth = pack.tree.depth[k], first = pack.tree.first(k);
    const Double before = reach[k];
    Double own = before;
    for (Index d = first > depth - ancestors ? first : depth - ancestors; d < depth; ++d) {
      const auto coupled = pack.number(pack.workspace.M, pack.tree.begin[k] + d) != Double(0);
      const Double other = reach[path[d]], together = max_(own, other);
      own = select(coupled, together, own);
      reach.put(path[d], select(coupled, together, other));
      grown = or_(grown, and_(coupled, together > other));
    }
    reach.put(k, own);
    grown = or_(grown, own > before);
  }
};

}  // namespace stiction::inline STICTION_ISA
