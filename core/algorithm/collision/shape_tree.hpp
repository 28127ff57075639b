#pragma once

#include <limits>

#include "core/algorithm/collision/moving_shape.hpp"
#include "core/algorithm/plan/sort_network.hpp"

/// A tree of boxes about the shapes of one environment, which are sorted along a space-filling curve. Node k has the
/// children 2 k and 2 k + 1, so there are no pointers, and the tree follows from the shapes. (Chitalu, Dubach and
/// Komura, Binary ostensibly-implicit trees for fast collision detection, Computer Graphics Forum 39(2), 2020.)
///
/// The tree only spares tests: bounds_overlap() has the last word on every pair. Hence no rounding in the order of the
/// shapes reaches a contact, and boxes may be larger than need be. They must not be too small: two shapes that pass
/// bounds_overlap() have boxes that overlap. Let u be half an ulp of 1, and r the value of reach_of(), with half the
/// margin. The test rounds a handful of times. On each axis the centres of such a pair are therefore at most (r_a +
/// r_b) (1 + 16 u) + t apart. Underflow can hide t: the root of four of the smallest normal numbers, below 1e-18. A
/// box goes r (1 + 64 u) + kUnderflow from the centre on both sides, so in exact numbers the ends overlap. Rounding is
/// monotone, so they do when they are rounded. Unions of boxes and comparisons do not round.
namespace stiction::inline STICTION_ISA {

/// Coordinates and reaches from which squares may overflow [m]. Such shapes are tested against all others.
inline constexpr double kFarAway = 1e18;
/// Beyond all boxes.
inline constexpr double kBeyond = 1e30;
inline constexpr double kUnderflow = 1e-15;
template <class Real>
inline constexpr Real kSlack = 32 * std::numeric_limits<Real>::epsilon();

template <class Real>
struct Box3 {
  Vector3<Real> low, high;
};

/// Holds nothing.
template <class Real>
STICTION_HD Box3<Real> empty_box() {
  const Real most = narrowed<Real>(kBeyond);
  return {{most, most, most}, {-most, -most, -most}};
}
template <class Real>
STICTION_HD Box3<Real> box_about(const Box3<Real>& a, const Box3<Real>& b) {
  return {{min_(a.low.x, b.low.x), min_(a.low.y, b.low.y), min_(a.low.z, b.low.z)},
          {max_(a.high.x, b.high.x), max_(a.high.y, b.high.y), max_(a.high.z, b.high.z)}};
}
template <class Real>
STICTION_HD bool boxes_overlap(const Box3<Real>& a, const Box3<Real>& b) {
  // All six at once: which of them fails cannot be guessed.
  return (static_cast<int>(a.low.x <= b.high.x) & static_cast<int>(b.low.x <= a.high.x) &
          static_cast<int>(a.low.y <= b.high.y) & static_cast<int>(b.low.y <= a.high.y) &
          static_cast<int>(a.low.z <= b.high.z) & static_cast<int>(b.low.z <= a.high.z)) != 0;
}

/// Distance from its centre at which a shape matters to a shape that has such a distance, too.
template <class Real>
STICTION_HD Real reach_of(const MovingShape<Real>& shape, Real margin) {
  return shape.bound + (shape.travel + Real(0.5) * margin);
}

template <class Real>
STICTION_HD Box3<Real> box_of(const MovingShape<Real>& shape, Real margin) {
  const Vector3<Real>& c = shape.placed.centre;
  const Real reach = reach_of(shape, margin);
  const Real wide = fma_(kSlack<Real>, reach, reach) + narrowed<Real>(kUnderflow);
  const Vector3<Real> r{wide, wide, wide};
  return {subtract(c, r), added(c, r)};
}

/// Place to search for a shape. A shape that is nowhere, with a NaN in its centre or its travel, passes no test.
enum class ShapePlace : std::uint8_t { tree, everywhere, nowhere };

template <class Real>
STICTION_HD ShapePlace place_of(const MovingShape<Real>& shape, Real margin) {
  if (shape.placed.kind == ShapeKind::plane) return ShapePlace::everywhere;
  const Vector3<Real>& c = shape.placed.centre;
  const Real far = narrowed<Real>(kFarAway);
  if (abs_(c.x) < far && abs_(c.y) < far && abs_(c.z) < far && reach_of(shape, margin) < far) return ShapePlace::tree;
  const bool is_somewhere = c.x == c.x && c.y == c.y && c.z == c.z && shape.travel == shape.travel;
  return is_somewhere ? ShapePlace::everywhere : ShapePlace::nowhere;
}

/// A shape in its place along the curve.
struct TreeLeaf {
  std::uint64_t code;
  Index shape;
};
/// Codes after those of all cells.
inline constexpr std::uint64_t kEverywhere = ~std::uint64_t{1};
inline constexpr std::uint64_t kNowhere = ~std::uint64_t{0};

/// The lowest 21 bits of the cell that a coordinate, below kFarAway, is in, two zeros after each of them.
template <class Real>
STICTION_HD std::uint64_t spread_cell(Real x, Real cells_per_length) {
  const Real cell = clamp_(x * cells_per_length, -narrowed<Real>(kFarAway), narrowed<Real>(kFarAway));
  std::uint64_t bits = static_cast<std::uint64_t>(static_cast<std::int64_t>(cell) + (std::int64_t{1} << 20)) & 0x1fffff;
  bits = (bits | bits << 32) & 0x1f00000000ffff;
  bits = (bits | bits << 16) & 0x1f0000ff0000ff;
  bits = (bits | bits << 8) & 0x100f00f00f00f00f;
  bits = (bits | bits << 4) & 0x10c30c30c30c30c3;
  return (bits | bits << 2) & 0x1249249249249249;
}

/// Morton's code of the shape's cell.
template <class Real>
STICTION_HD std::uint64_t code_of(const WorldModelView<Real>& model, const MovingShape<Real>& shape) {
  const ShapePlace place = place_of(shape, model.margin);
  if (place != ShapePlace::tree) return place == ShapePlace::everywhere ? kEverywhere : kNowhere;
  const Vector3<Real>& c = shape.placed.centre;
  return spread_cell(c.x, model.cells_per_length) | spread_cell(c.y, model.cells_per_length) << 1 |
         spread_cell(c.z, model.cells_per_length) << 2;
}

/// Leaves of the smallest full tree over that many shapes.
STICTION_HD constexpr Offset leaves_for(Index shapes) {
  Offset leaves = 1;
  while (leaves < shapes) leaves *= 2;
  return leaves;
}

/// leaf[0 .. in_tree) are the shapes in the tree, leaf[in_tree .. to_test) those that are tested against all others.
template <class Real>
struct ShapeTree {
  MovingShape<Real>* shape;  ///< (shapes)
  TreeLeaf* leaf;            ///< (shapes)
  Box3<Real>* node;          ///< the root is 1, the leaf of leaf[i] is leaves + i       (2 * leaves_for(shapes))
  Offset leaves;
  Index in_tree, to_test;

  /// Finds the last three once leaves are sorted.
  STICTION_HD void measure(Index shapes) {
    const auto first_of = [&](std::uint64_t code) {
      return lower_bound(leaf, shapes, code, [](const TreeLeaf& one, std::uint64_t key) { return one.code < key; });
    };
    in_tree = first_of(kEverywhere);
    to_test = first_of(kNowhere);
    leaves = leaves_for(in_tree);
  }
};

/// Sorts the shapes, which are where they are, and makes the boxes.
template <Team TeamT, class Real>
STICTION_HD void build_tree(TeamT& team, const WorldModelView<Real>& model, ShapeTree<Real>& tree) {
  for_each(team, model.shapes, [&](Index shape) { tree.leaf[shape] = {code_of(model, tree.shape[shape]), shape}; });
  sort_network(team, model.shapes, tree.leaf, [](const TreeLeaf& one, const TreeLeaf& other) {
    return one.code < other.code || (one.code == other.code && one.shape < other.shape);
  });
  tree.measure(model.shapes);
  for_each(team, static_cast<Index>(tree.leaves), [&](Index k) {
    tree.node[tree.leaves + k] =
        k < tree.in_tree ? box_of(tree.shape[tree.leaf[k].shape], model.margin) : empty_box<Real>();
  });
  for (Offset first = tree.leaves / 2; first > 0; first /= 2)
    for_each(team, static_cast<Index>(first), [&](Index k) {
      const Offset node = first + k;
      tree.node[node] = box_about(tree.node[2 * node], tree.node[2 * node + 1]);
    });
}

/// Neighbouring leaves that are looked at one by one: branches above them would spare little.
inline constexpr Offset kSpan = 16;

/// f(shape) for every shape in the tree whose box overlaps a box.
template <class Real, class F>
STICTION_HD void for_each_in_box(const ShapeTree<Real>& tree, const Box3<Real>& box, F&& f) {
  const Offset span = tree.leaves < kSpan ? tree.leaves : kSpan;
  Offset node = 1;
  do {
    if (boxes_overlap(tree.node[node], box)) {
      if (node * span < tree.leaves) {
        node *= 2;
        continue;
      }
      for (Offset leaf = node * span; leaf < (node + 1) * span; ++leaf)
        if (boxes_overlap(tree.node[leaf], box)) f(tree.leaf[leaf - tree.leaves].shape);
    }
    // The next node to the right: that of the nearest ancestor that is a left child. The root has none.
    while ((node & 1) != 0) node /= 2;
    node |= 1;
  } while (node > 1);
}

}  // namespace stiction::inline STICTION_ISA
