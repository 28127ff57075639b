#pragma once

#include "core/algorithm/velocity/lanes/slots.hpp"

/// Which environments are best solved side by side. A pack has a slot for every kind of cone that any of its lanes has,
/// so like cones make few slots. No number depends on it: integers only (docs/math/velocity_newton.md, "Lanes").
namespace stiction::inline STICTION_ISA {

/// Environments with near keys have like cones. The first to differ decides, the dearest: the cost of a
/// slot grows with its rows and with the square of its columns.
struct Likeness {
  bool in_double = false;   ///< how steps are taken is another pack's affair
  Index dofs = 0;           ///< of the environment
  std::uint64_t cones = 0;  ///< the four last kinds that have several rows or columns: a hash of 12 bits, and how many
  std::uint64_t singles = 0;  ///< rows of one degree of freedom: each turns its bit
  Index at = 0;               ///< where the environment is, so that the order is one of integers

  STICTION_HD bool operator<(const Likeness& other) const {
    if (in_double != other.in_double) return other.in_double;
    if (dofs != other.dofs) return dofs < other.dofs;
    if (cones != other.cones) return cones < other.cones;
    if (singles != other.singles) return singles < other.singles;
    return at < other.at;
  }
};

/// Twelve bits of a cone: its rows, and the degrees of freedom that it touches. By multiplication with the golden
/// ratio's digits and an odd number (Knuth, The Art of Computer Programming 3, 6.4).
STICTION_HD std::uint64_t kind_of(const SlotItem<DofSet>& item) {
  std::uint64_t mixed = item.dofs * 0x9E3779B97F4A7C15U + static_cast<std::uint64_t>(item.rows) * 0xC2B2AE3D27D4EB4FU;
  mixed = (mixed ^ (mixed >> 29U)) * 0xBF58476D1CE4E5B9U;
  return mixed >> 52U;
}

/// Returns the likeness of an environment whose cones are in order  (count).
STICTION_HD Likeness likeness_of(const SlotItem<DofSet>* items, Index count, Index dofs, bool in_double, Index at) {
  constexpr Index kKinds = 4, kMostAlike = 15;
  Likeness key{in_double, dofs, 0, 0, at};
  Index kinds = 0;
  for (Index last = count - 1; last >= 0;) {
    if (items[last].rows == 1 && size_of(items[last].dofs) == 1) {
      key.singles ^= items[last--].dofs;
      continue;
    }
    Index next = last;
    while (next >= 0 && share_a_slot(items[next], items[last])) --next;
    const Index alike = last - next < kMostAlike ? last - next : kMostAlike;
    if (kinds < kKinds)
      key.cones |= (kind_of(items[last]) << 4U | static_cast<std::uint64_t>(alike)) << 16 * (kKinds - 1 - kinds);
    ++kinds;
    last = next;
  }
  return key;
}

}  // namespace stiction::inline STICTION_ISA
