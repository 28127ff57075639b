#pragma once

#include <type_traits>

#include "core/base/macros.hpp"
#include "core/job/cone_counts.hpp"

namespace stiction::inline STICTION_ISA {

/// Kind and row count of a cone as a type, so that loops over its rows unroll. Boxed friction has the shape of a
/// friction cone: a system's `lo` distinguishes the two (docs/math/box_friction.md). A semidefinite matrix has the
/// same, and the environment's kinds distinguish them (docs/math/semidefinite.md).
template <ConeKind kKindValue, int kRowsValue>
struct ConeShape {
  static constexpr ConeKind kKind = kKindValue;
  static constexpr int kRows = kRowsValue;
};

/// Runs of equal cones in canonical order: f(shape, count, first cone, first row) for each kind.
template <class F>
STICTION_HD void for_each_segment(const ConeCounts& counts, F&& f) {
  Index cone = 0;
  Index row = 0;
  const auto segment = [&](auto shape, Index count) {
    f(shape, count, cone, row);
    cone += count;
    row += count * decltype(shape)::kRows;
  };
  segment(ConeShape<ConeKind::free, 1>{}, counts.free);
  segment(ConeShape<ConeKind::unilateral, 1>{}, counts.unilateral);
  segment(ConeShape<ConeKind::box, 1>{}, counts.box);
  segment(ConeShape<ConeKind::friction, 2>{}, counts.friction[2]);
  segment(ConeShape<ConeKind::friction, 3>{}, counts.friction[3]);
  segment(ConeShape<ConeKind::friction, 4>{}, counts.friction[4]);
  segment(ConeShape<ConeKind::friction, 5>{}, counts.friction[5]);
  segment(ConeShape<ConeKind::friction, 6>{}, counts.friction[6]);
}

/// f(shape) for a cone whose kind and size are known at run time only.
template <class F>
STICTION_HD auto with_shape(ConeKind kind, Index rows, F&& f) {
  if (kind >= ConeKind::friction) {
    switch (rows) {
      case 2:
        return f(ConeShape<ConeKind::friction, 2>{});
      case 3:
        return f(ConeShape<ConeKind::friction, 3>{});
      case 4:
        return f(ConeShape<ConeKind::friction, 4>{});
      case 5:
        return f(ConeShape<ConeKind::friction, 5>{});
      default:
        return f(ConeShape<ConeKind::friction, 6>{});
    }
  }
  if (kind == ConeKind::box) return f(ConeShape<ConeKind::box, 1>{});
  if (kind == ConeKind::free) return f(ConeShape<ConeKind::free, 1>{});
  return f(ConeShape<ConeKind::unilateral, 1>{});
}

/// f(rows) of a cone. On the device they are a constant, so that arrays of a cone's numbers can be registers.
template <class F>
STICTION_HD auto with_row_count(ConeKind kind, Index rows, F&& f) {
  if constexpr (kForDevice) {
    return with_shape(kind, rows,
                      [&](auto shape) { return f(std::integral_constant<Index, decltype(shape)::kRows>{}); });
  } else {
    return f(rows);
  }
}

/// Place of a cone in a system's arrays.
struct ConeSlot {
  Index cone;
  Index row;
};

/// The slot of the cone at canonical position `position` of an environment with cones `own`, in a system laid out for
/// `slots` >= own. (A pack is laid out for the largest count of each kind among its lanes.)
STICTION_HD ConeSlot locate(const ConeCounts& own, const ConeCounts& slots, Index position) {
  Index before = 0;
  ConeSlot base{0, 0};
  const auto visit = [&](Index own_count, Index slot_count, Index rows) {
    const Index ordinal = position - before;
    if (ordinal < own_count) {
      base.cone += ordinal;
      base.row += ordinal * rows;
      return true;
    }
    before += own_count;
    base.cone += slot_count;
    base.row += slot_count * rows;
    return false;
  };
  if (visit(own.free, slots.free, 1) || visit(own.unilateral, slots.unilateral, 1) || visit(own.box, slots.box, 1))
    return base;
  for (Index m = 2; m <= kMaxConeRows; ++m)
    if (visit(own.friction[m], slots.friction[m], m)) return base;
  return base;
}

}  // namespace stiction::inline STICTION_ISA
