#pragma once

#include "core/algorithm/articulated/fields/prism.hpp"
#include "core/job/articulated_job.hpp"

namespace stiction::inline STICTION_ISA {

/// A height field in its own frame: cells of two triangles each, cut from their first corner to their last.
template <class T>
struct FieldGrid {
  const ArticulatedFieldData<T>& field;
  const T* height;  ///< of all fields

  [[nodiscard]] STICTION_HD Vector3<T> vertex(Index row, Index column) const {
    return {field.cell[0] * static_cast<T>(column) - field.half[0], field.cell[1] * static_cast<T>(row) - field.half[1],
            height[field.first + Offset{row} * field.columns + column]};
  }
  /// Triangles of a cell: the one above the cut, seen from above, and the one below it.
  [[nodiscard]] STICTION_HD Triangle3<T> triangle(Index row, Index column, Index half) const {
    const Vector3<T> first = vertex(row, column), last = vertex(row + 1, column + 1);
    if (half == 0) return {vertex(row + 1, column), first, last};
    return {first, vertex(row, column + 1), last};
  }
  /// The cell of a row, axis 0, or of a column, axis 1, that a coordinate is over, or the nearest one.
  [[nodiscard]] STICTION_HD Index cell_at(int axis, T place) const {
    const T cells = div_(place + field.half[axis], field.cell[axis]);
    const Index last = (axis == 0 ? field.columns : field.rows) - 2;
    if (!(cells > T(0))) return 0;
    return cells < static_cast<T>(last) ? static_cast<Index>(cells) : last;
  }
  [[nodiscard]] STICTION_HD bool is_over(const Vector3<T>& p) const {
    return abs_(p.x) <= field.half[0] && abs_(p.y) <= field.half[1];
  }
  /// The triangle that a point over the field is over.
  [[nodiscard]] STICTION_HD Triangle3<T> triangle_at(const Vector3<T>& p) const {
    const Index row = cell_at(1, p.y), column = cell_at(0, p.x);
    const Vector3<T> from = subtract(p, vertex(row, column));
    return triangle(row, column, from.y * field.cell[0] > from.x * field.cell[1] ? 0 : 1);
  }

  /// Returns true for a point of the grid that is on a ridge or a peak. Along x, y or the cuts it is above the middle
  /// of two neighbours, and along none below it. Beyond the field's end all is at its bottom.
  [[nodiscard]] STICTION_HD bool is_ridge(Index row, Index column) const {
    constexpr Index kStep[3][2] = {{0, 1}, {1, 0}, {1, 1}};
    const T own = vertex(row, column).z;
    const T same = (sizeof(T) == sizeof(double) ? T(1e-9) : T(1e-4)) * (field.cell[0] + field.cell[1]);
    bool is_above = false;
    for (const auto& step : kStep) {
      const Index before[2] = {row - step[0], column - step[1]}, after[2] = {row + step[0], column + step[1]};
      const bool is_inside = before[0] >= 0 && before[1] >= 0 && after[0] < field.rows && after[1] < field.columns;
      const T middle =
          is_inside ? T(0.5) * (vertex(before[0], before[1]).z + vertex(after[0], after[1]).z) : -field.base;
      if (own < middle - same) return false;
      is_above = is_above || own > middle + same;
    }
    return is_above;
  }

  /// f(top) of all prisms whose top is above `low` in cells that a box reaches into, rows first.
  template <class F>
  STICTION_HD void for_each_top(const Vector3<T>& low, const Vector3<T>& high, F&& f) const {
    if (low.x > field.half[0] || high.x < -field.half[0] || low.y > field.half[1] || high.y < -field.half[1]) return;
    const Index last_row = cell_at(1, high.y), last_column = cell_at(0, high.x);
    for (Index row = cell_at(1, low.y); row <= last_row; ++row)
      for (Index column = cell_at(0, low.x); column <= last_column; ++column)
        for (Index half = 0; half < 2; ++half) {
          const Triangle3<T> top = triangle(row, column, half);
          if (top.a.z < low.z && top.b.z < low.z && top.c.z < low.z) continue;
          f(top);
        }
  }
};

}  // namespace stiction::inline STICTION_ISA
