#pragma once

#include "core/algorithm/rigid/body_env.hpp"
#include "core/base/pack_gather.hpp"

/// Between which bodies the contacts of a pack's lanes are. Host only.
namespace stiction::inline STICTION_ISA {

/// One side of a contact in every lane, as in BodyEnv::sides.
template <class T, int W>
struct LaneSides {
  PackIndices<T, W> side;
  Offset side_index;  ///< as in BodyEnv::side()
  bool is_uniform;    ///< all lanes have the same slot
};

template <class T, int W>
STICTION_HD PackMask<T, W> is_pushed(const LaneSides<T, W>& sides) {
  return {sides.side >= 0};
}

/// Slots of the bodies of a side.
template <class T, int W>
struct LaneSlots {
  PackIndices<T, W> slot;
  Offset side_index;
  bool is_uniform;
};

template <class T, int W>
STICTION_HD LaneSlots<T, W> slot_of(const LaneSides<T, W>& sides) {
  return {sides.side >= 0 ? sides.side : ~sides.side, sides.side_index, sides.is_uniform};
}

/// A side whose slot is the same in every lane.
template <class T, int W>
struct UniformSide {
  PackMask<T, W> pushed;
  Index slot;
};
template <class T, int W>
STICTION_HD PackMask<T, W> is_pushed(const UniformSide<T, W>& side) {
  return side.pushed;
}
template <class T, int W>
STICTION_HD Index slot_of(const UniformSide<T, W>& side) {
  return side.slot;
}

/// Plan data that a pack keeps: sides by position, lane by lane. A lane that has no contact at a position has a side
/// there that nothing pushes, the same as another lane's.
template <class T, int W>
struct PackSides {
  using Word = typename PackMask<T, W>::Word;
  Word* side = nullptr;
  std::uint8_t* is_uniform = nullptr;

  [[nodiscard]] STICTION_HD LaneSides<T, W> of(Offset side_index) const {
    return {*reinterpret_cast<const PackIndices<T, W>*>(side + side_index * W), side_index,
            is_uniform[side_index] != 0};
  }
};

/// The blocks of a pack, by their last positions. Null without blocks.
template <class T, int W>
struct PackBlocks {
  /// Counts the contacts of the block that ends at a position, in every lane; 0 where none ends.
  struct Lanes {
    PackIndices<T, W> count;
  };
  const Lanes* ends = nullptr;
  const Index* longest = nullptr;  ///< of all lanes

  /// The lanes in which the block that ends at `last` has contact p.
  [[nodiscard]] STICTION_HD PackMask<T, W> has(Index last, Index p) const { return {ends[last].count > last - p}; }
};

/// Sides as an environment has them, for visit_of().
template <class T, int W>
struct PackEnv {
  PackSides<T, W> sides;
  PackBlocks<T, W> blocks{};
  [[nodiscard]] STICTION_HD LaneSides<T, W> side(Offset side_index) const { return sides.of(side_index); }
};
/// Sides of contacts of which both are uniform.
template <class T, int W>
struct UniformEnv {
  PackSides<T, W> sides;
  [[nodiscard]] STICTION_HD UniformSide<T, W> side(Offset side_index) const {
    const LaneSides<T, W> lanes = sides.of(side_index);
    return {is_pushed(lanes), slot_of(static_cast<Index>(lanes.side[0]))};
  }
};
template <class T, int W>
STICTION_HD bool is_uniform(const PackEnv<T, W>& env, Index p) {
  const Offset side_index = 2 * static_cast<Offset>(p);
  return env.sides.is_uniform[side_index] != 0 && env.sides.is_uniform[side_index + 1] != 0;
}

/// f(uniform, first, end) for runs of contacts in order, all of them `is_uniform_at` or none.
template <class Test, class F>
STICTION_HD void for_each_run(Index count, Test&& is_uniform_at, F&& f) {
  for (Index first = 0; first < count;) {
    const bool uniform = is_uniform_at(first);
    Index end = first + 1;
    while (end < count && is_uniform_at(end) == uniform) ++end;
    f(uniform, first, end);
    first = end;
  }
}

}  // namespace stiction::inline STICTION_ISA
