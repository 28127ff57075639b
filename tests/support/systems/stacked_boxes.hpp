#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <set>
#include <vector>

#include "core/algorithm/linear/block/block_matrix.hpp"
#include "core/job/multigrid_view.hpp"
#include "core/plan/block_sets.hpp"

/// Body-space matrices H = M + J'WJ of boxes that lie on each other, every contact held: W = 1/R on all its rows.
namespace stiction::test {

using Vector3 = std::array<double, 3>;

/// A matrix that owns its arrays.
struct OwnedBlocks {
  BlockSet pattern;
  std::vector<double> values;
  [[nodiscard]] BlockMatrix view() { return {pattern.view(), values.data()}; }
};

/// The pattern of a graph: a diagonal and, for each edge, both its blocks.
inline BlockSet pattern_of(Index bodies, const std::vector<std::array<Index, 2>>& edges) {
  std::vector<std::set<Index>> rows(static_cast<std::size_t>(bodies));
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].insert(static_cast<Index>(i));
  for (const auto& [a, b] : edges) {
    rows[static_cast<std::size_t>(a)].insert(b);
    rows[static_cast<std::size_t>(b)].insert(a);
  }
  BlockSet set;
  set.columns_total = bodies;
  for (const std::set<Index>& row : rows) {
    set.columns.insert(set.columns.end(), row.begin(), row.end());
    set.offsets.push_back(static_cast<Index>(set.columns.size()));
  }
  return set;
}

/// Unit cubes of mass 1 and the points where they touch; body -1 is the ground.
class StackedBoxes {
 public:
  static StackedBoxes tower(Index boxes) {
    StackedBoxes scene;
    for (Index level = 0; level < boxes; ++level) scene.add_box({0, 0, level + 0.5});
    return scene;
  }
  /// n courses of n boxes, each half a box beside the course below.
  static StackedBoxes wall(Index n) {
    StackedBoxes scene;
    for (Index level = 0; level < n; ++level)
      for (Index i = 0; i < n; ++i) scene.add_box({1.02 * (i + 0.5 * (level % 2)), 0, level + 0.5});
    return scene;
  }
  /// Square courses, the lowest of n times n boxes, the highest of one.
  static StackedBoxes pyramid(Index n) {
    StackedBoxes scene;
    for (Index level = 0; level < n; ++level)
      for (Index i = 0; i < n - level; ++i)
        for (Index j = 0; j < n - level; ++j)
          scene.add_box({1.1 * (i + 0.5 * level), 1.1 * (j + 0.5 * level), level + 0.5});
    return scene;
  }

  /// A box; it touches the boxes already there that it lies on, or the ground.
  void add_box(const Vector3& center) {
    const Index body = bodies();
    if (center[2] < 1.0) add_bed(-1, center, body, center);
    for (Index other = 0; other < body; ++other) {
      const Vector3 below = position(other);
      if (center[2] - below[2] > 0.99 && center[2] - below[2] < 1.01) add_bed(other, below, body, center);
    }
    positions_.insert(positions_.end(), center.begin(), center.end());
  }
  void lift_off_the_ground() {
    std::erase_if(points_, [](const Point& point) { return point.a < 0; });
  }

  /// Opens about `percent` of the beds between two boxes: they stay in the graph, and hold nothing.
  void open_beds(unsigned percent) {
    for (Point& point : points_) {
      auto mixed = static_cast<unsigned>(7919 * point.a + 104729 * point.b) * 2654435761U;
      mixed = (mixed ^ (mixed >> 15U)) * 2246822519U;
      point.is_open = point.a >= 0 && (mixed ^ (mixed >> 13U)) % 100U < percent;
    }
  }

  [[nodiscard]] Index bodies() const { return static_cast<Index>(positions_.size() / 3); }
  [[nodiscard]] const std::vector<double>& positions() const { return positions_; }
  [[nodiscard]] Vector3 position(Index body) const {
    const auto first = 3 * static_cast<std::size_t>(body);
    return {positions_[first], positions_[first + 1], positions_[first + 2]};
  }

  /// `mass` times M (1, and 1/6 about each axis of a unit cube) + J'J / R.
  [[nodiscard]] OwnedBlocks matrix(double R, double mass = 1.0) const {
    OwnedBlocks H;
    std::vector<std::array<Index, 2>> edges;
    for (const Point& point : points_)
      if (point.a >= 0) edges.push_back({point.a, point.b});
    H.pattern = pattern_of(bodies(), edges);
    H.values.assign(H.pattern.columns.size() * 36, 0.0);
    for (Index body = 0; body < bodies(); ++body)
      for (std::size_t i = 0; i < 6; ++i) block(H, body, body)[7 * i] = i < 3 ? mass : mass / 6.0;
    for (const Point& point : points_) {
      if (point.is_open) continue;
      add_term(H, point, point.b, point.b, 1.0 / R);
      if (point.a < 0) continue;
      add_term(H, point, point.a, point.a, 1.0 / R);
      add_term(H, point, point.a, point.b, -1.0 / R);
      add_term(H, point, point.b, point.a, -1.0 / R);
    }
    return H;
  }

 private:
  struct Point {
    Index a, b;
    Vector3 place;
    bool is_open;
  };

  /// Four points at the corners of the rectangle that two boxes share, none where they do not.
  void add_bed(Index a, const Vector3& lower, Index b, const Vector3& upper) {
    const double x_low = std::max(lower[0], upper[0]) - 0.5, x_high = std::min(lower[0], upper[0]) + 0.5;
    const double y_low = std::max(lower[1], upper[1]) - 0.5, y_high = std::min(lower[1], upper[1]) + 0.5;
    if (x_low >= x_high || y_low >= y_high) return;
    for (const double x : {x_low, x_high})
      for (const double y : {y_low, y_high}) points_.push_back({a, b, {x, y, upper[2] - 0.5}, false});
  }

  static double* block(OwnedBlocks& H, Index row, Index column) {
    const auto first = H.pattern.columns.begin() + H.pattern.offsets[static_cast<std::size_t>(row)];
    const auto found = std::find(first, H.pattern.columns.end(), column);
    return H.values.data() + 36 * (found - H.pattern.columns.begin());
  }

  /// The point's velocity on a body: v + w x d = [I, -[d]x] (v, w).
  [[nodiscard]] std::array<Vector3, 6> columns(const Point& point, Index body) const {
    const Vector3 center = position(body);
    const double x = point.place[0] - center[0], y = point.place[1] - center[1], z = point.place[2] - center[2];
    return {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, -z, y}, {z, 0, -x}, {-y, x, 0}}};
  }
  /// Adds weight * (motion of row's body)' (motion of column's).
  void add_term(OwnedBlocks& H, const Point& point, Index row, Index column, double weight) const {
    const std::array<Vector3, 6> left = columns(point, row), right = columns(point, column);
    double* const K = block(H, row, column);
    for (std::size_t i = 0; i < 6; ++i)
      for (std::size_t j = 0; j < 6; ++j)
        for (std::size_t k = 0; k < 3; ++k) K[6 * i + j] += weight * left[i][k] * right[j][k];
  }

  std::vector<double> positions_;
  std::vector<Point> points_;
};

}  // namespace stiction::test
