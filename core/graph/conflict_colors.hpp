#pragma once

#include <cstdint>
#include <vector>

#include "core/graph/body_graph.hpp"
#include "core/graph/tally.hpp"

namespace stiction::graph {

/// The greedy colouring of the manifolds in order of priority. Each has the smallest colour that none of higher
/// priority has with which it shares a moving body. Changes are collected first and settled together; between two
/// settlings every addition comes before the first removal, so that no slot is used twice.
class ConflictColors {
 public:
  void manifold_added(Index slot);
  /// Told while the manifold is still in the graph.
  void manifold_removed(const BodyGraph& graph, Index slot);
  /// Evaluates manifolds that may have changed, highest priority first, so that nothing is evaluated twice.
  void settle(const BodyGraph& graph, GraphChange& change);
  void rebuild(const BodyGraph& graph);

  [[nodiscard]] Index color(Index slot) const { return color_[at(slot)]; }
  [[nodiscard]] Index color_count() const { return static_cast<Index>(used_.most(-1)) + 1; }

 private:
  struct Waiting {
    std::uint64_t priority;
    Index slot;
  };

  void wait(const BodyGraph& graph, Index slot);
  void wait_for_change(const BodyGraph& graph, Index slot, Index before, Index after);
  Index smallest_free(const BodyGraph& graph, Index slot);
  void set_color(Index slot, Index color);

  std::vector<Index> color_;  ///< of each manifold slot, -1: none yet
  std::vector<bool> waits_;
  std::vector<Index> added_;          ///< new since the last settling; their priority is read then
  std::vector<Waiting> queue_;        ///< a heap
  std::vector<std::uint64_t> taken_;  ///< stamp of the last evaluation that found each colour taken
  std::uint64_t stamp_ = 0;
  Tally used_;
};

}  // namespace stiction::graph
