#pragma once

#include "core/algorithm/collision/shape_tree.hpp"
#include "core/job/shape_pairs.hpp"
#include "core/team/scan.hpp"

/// The pairs of a large environment that a step looks closer at: those that pass bounds_overlap(), in order of their
/// numbers. These are the pairs that testing all against all would find.
namespace stiction::inline STICTION_ISA {

/// Near pairs of a shape that are kept when they are counted, so that the tree is not asked again.
inline constexpr Index kKept = 12;

struct NearPair {
  Offset number;
  Index shape_a, shape_b;
};

/// Memory of one environment while its near pairs are found, and until its contacts are listed.
template <class Real>
struct NearWorkspace {
  ShapeTree<Real> tree;
  Offset*
      first;  ///< near pairs before each shape's: with the world for all shapes, then with later ones (2 * shapes + 1)
  Index* other;   ///< the first few others of a shape's near pairs                                     (kKept * shapes)
  Offset* parts;  ///< of a scan                                                                            (kScanParts)

  static_assert(alignof(TreeLeaf) == alignof(Offset) && alignof(Offset) >= alignof(Box3<Real>) &&
                alignof(Box3<Real>) == alignof(MovingShape<Real>) && alignof(Box3<Real>) >= alignof(Index));
  static STICTION_HD Offset bytes(const WorldModelView<Real>& model) {
    return Offset{model.shapes} *
               static_cast<Offset>(sizeof(TreeLeaf) + sizeof(MovingShape<Real>) + kKept * sizeof(Index)) +
           (Offset{2} * model.shapes + 1 + kScanParts) * static_cast<Offset>(sizeof(Offset)) +
           2 * leaves_for(model.shapes) * static_cast<Offset>(sizeof(Box3<Real>));
  }
  STICTION_HD NearWorkspace(const WorldModelView<Real>& model, void* memory) {
    tree.leaf = static_cast<TreeLeaf*>(memory);
    first = reinterpret_cast<Offset*>(tree.leaf + model.shapes);
    parts = first + Offset{2} * model.shapes + 1;
    tree.node = reinterpret_cast<Box3<Real>*>(parts + kScanParts);
    tree.shape = reinterpret_cast<MovingShape<Real>*>(tree.node + 2 * leaves_for(model.shapes));
    other = reinterpret_cast<Index*>(tree.shape + model.shapes);
  }
};

/// f(the other shape) for every near pair that this shape counts as its own. They are the ones with shapes of the
/// world, and with shapes after it. A shape of the world has none.
template <class Real, class F>
STICTION_HD void for_each_own_pair(const WorldModelView<Real>& model, const ShapeTree<Real>& tree, Index shape, F&& f) {
  const Index body = model.shape[shape].body;
  const MovingShape<Real>& own = tree.shape[shape];
  const ShapePlace place = place_of(own, model.margin);
  if (body < 0 || place == ShapePlace::nowhere) return;
  const auto test = [&](Index other) {
    const Index other_body = model.shape[other].body;
    if (other_body == body || (other_body >= 0 && other < shape)) return;
    // As a pair has them: the world's shapes are before all others.
    const MovingShape<Real>& a = other < shape ? tree.shape[other] : own;
    const MovingShape<Real>& b = other < shape ? own : tree.shape[other];
    if (bounds_overlap(a, b, pair_margin(model, a, b))) f(other);
  };
  if (place == ShapePlace::everywhere) {
    for (Index other = 0; other < model.shapes; ++other) test(other);
    return;
  }
  for_each_in_box(tree, box_of(own, model.margin), test);
  for (Index k = tree.in_tree; k < tree.to_test; ++k) test(tree.leaf[k].shape);
}

/// Counts the near pairs of an environment.
template <Team TeamT, class Real>
STICTION_HD Offset count_near_pairs(TeamT& team, const WorldJob<Real>& job, Offset env,
                                    NearWorkspace<Real>& workspace) {
  const WorldModelView<Real>& model = job.model;
  pose_shapes(team, job, env, workspace.tree.shape);
  build_tree(team, model, workspace.tree);
  Offset* const first = workspace.first;
  for_each(team, model.shapes, [&](Index shape) {
    Index* const kept = workspace.other + Offset{kKept} * shape;
    Offset with_world = 0, with_later = 0;
    for_each_own_pair(model, workspace.tree, shape, [&](Index other) {
      if (with_world + with_later < kKept) kept[with_world + with_later] = other;
      ++(other < shape ? with_world : with_later);
    });
    first[shape] = with_world;
    first[model.shapes + shape] = with_later;
  });
  const Offset total = exclusive_scan(team, first, 2 * model.shapes, workspace.parts);
  single(team, [&] { first[Offset{2} * model.shapes] = total; });
  return total;
}

/// Writes them, after they were counted, to `near`. The order of numbers is that of the lower body, then of the other
/// one. The world's pairs hence come first, in order of the other body, and then those of each body. Within such a run
/// they are sorted.
template <Team TeamT, class Real>
STICTION_HD void list_near_pairs(TeamT& team, const WorldModelView<Real>& model, const NearWorkspace<Real>& workspace,
                                 NearPair* near) {
  const Offset* const first = workspace.first;
  for_each(team, model.shapes, [&](Index shape) {
    Offset with_world = first[shape], with_later = first[model.shapes + shape];
    const Offset count = (first[shape + 1] - with_world) + (first[model.shapes + shape + 1] - with_later);
    const auto add = [&](Index other) {
      const bool is_later = other > shape;
      const ShapePair pair = is_later ? shape_pair(model, shape, other) : shape_pair(model, other, shape);
      near[is_later ? with_later++ : with_world++] = {pair_number(model, pair), pair.shape_a, pair.shape_b};
    };
    if (count > kKept) return for_each_own_pair(model, workspace.tree, shape, add);
    for (Index k = 0; k < static_cast<Index>(count); ++k) add(workspace.other[Offset{kKept} * shape + k]);
  });
  for_each(team, model.bodies, [&](Index body) {
    const BodyShapes& own = shapes_of_body(model, body);
    SerialTeam alone;
    for (const Index shift : {Index{0}, model.shapes}) {
      const Offset begin = first[shift + own.begin];
      sort_network(alone, static_cast<Index>(first[shift + own.end] - begin), near + begin,
                   [](const NearPair& one, const NearPair& other) { return one.number < other.number; });
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
