#pragma once

#include "core/algorithm/articulated/row_classes.hpp"

/// Memory of the rows that a pack's robots have.
namespace stiction::inline STICTION_ISA {

/// Rows of a pack in the order of the solve, and the tree that they make of its degrees of freedom.
template <class Types>
struct RobotLists {
  SlotOf<Types>* slots;     ///<                                                    (most_rows)
  SmallOf<Types>* columns;  ///< of each class, twice                               (2 columns of all classes)
  Index* groups_of;         ///< how many groups each class has here                (classes)
  TreeOf<Types>* own_tree;  ///< that is not the model's                            (1)
  DofSet* coupled;          ///< degrees of freedom before each, as the tree grows  (dof_count)
  const TreeOf<Types>* tree = nullptr;  ///< of the solve: own_tree, or the model's

  /// Lays the lists of a model out in memory, or measures them. Returns bytes.
  template <class T>
  STICTION_HD Offset place(const ArticulatedModelView<T>& model, char* memory) {
    ArrayTaker take{memory};
    take(slots, model.most_rows);
    take(columns, 2 * column_count(model));
    take(groups_of, model.classes);
    take(own_tree, 1);
    take(coupled, model.dof_count);
    return take.used;
  }
};

/// Returns true if each row touches degrees of freedom of one path of the model's tree alone. It couples nothing new,
/// so that tree is the solve's, and the depths of its columns are written. Robots then read one tree together.
template <class Types>
STICTION_HD bool keeps_tree(const RobotTree& tree, SlotOf<Types>* slots, Index slot_count) {
  for (Index s = 0; s < slot_count; ++s) {
    const auto& slot = slots[s];
    if (slot.columns == 0 || (s > 0 && slot.dof == slots[s - 1].dof)) continue;  // a class has its columns once
    const Index last = slot.dof[slot.columns - 1];
    for (Index c = 0; c < slot.columns; ++c) {
      const Index dof = slot.dof[c], depth = tree.depth[dof];
      if (depth > tree.depth[last] || tree.path(last)[depth] != dof) return false;
      slot.depth()[c] = static_cast<SmallOf<Types>>(depth);
    }
  }
  return true;
}

/// Rows of a robot that has all its model's: no other one has more.
template <class T>
STICTION_HD SlotCounts most_slots(const ArticulatedModelView<T>& model) {
  SlotCounts most;
  for (Index c = 0; c < model.classes; ++c) {
    const RowClass& rows = model.row_class[c];
    const Index slots = (rows.end - rows.begin) * rows.cones;
    most.slots += slots;
    most.rows += slots * rows.rows;
    most.singles += rows.rows == 1 ? slots : 0;
    most.entries += Offset{slots} * rows.rows * rows.column_count;
  }
  return most;
}

}  // namespace stiction::inline STICTION_ISA
