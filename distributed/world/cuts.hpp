#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "distributed/solve/partition.hpp"
#include "distributed/transport/transport.hpp"

namespace stiction::distributed {

/// Planes that cut space into a cell for each rank: recursive coordinate bisection of distributed points.
/// A half is cut across its longest extent. Points of equal coordinate go by their number. Coordinates are compared as
/// floats, a NaN as 0.
class Cuts {
 public:
  /// Every rank's cell is everywhere.
  Cuts() = default;
  /// Cells of as many points as bisect() has in its parts. All ranks call this, each with some points, and all get the
  /// same cuts. \throws RankLost
  Cuts(Transport& transport, std::span<const Index> number, std::span<const Point> points);

  /// The rank in whose cell a point is.
  [[nodiscard]] int owner(Index number, const Point& point) const;

 private:
  /// Ranks first .. first + count - 1; those of the lower half have keys below `key`.
  struct Node {
    int first = 0, count = 1;
    std::size_t axis = 0;
    std::uint64_t key = 0;
    std::size_t lower = 0, upper = 0;  ///< of nodes; 0: a cell
  };
  /// The nodes from one on, which are of one level, and the points that this rank has of them.
  struct Level {
    std::size_t begin;
    std::span<const Index> number;
    std::span<const Point> points;
    std::vector<std::size_t> node;  ///< of each point
  };
  void cut(Transport& transport, Level& level);
  void halve(Level& level);
  /// f(point, node) for the points of this level's halves.
  template <class F>
  void for_each_point(const Level& level, F&& f) const;

  std::vector<Node> nodes_{Node{}};
};

}  // namespace stiction::distributed
