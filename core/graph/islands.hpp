#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <vector>

#include "core/graph/body_graph.hpp"

namespace stiction::graph {

struct Island {
  std::set<Index> bodies;
  Offset contact_count = 0;
};

/// Connected components of the moving bodies, updated at every change of the graph.
class Islands {
 public:
  void body_added(Index body);
  /// The body has no manifold left.
  void body_removed(Index body);
  /// Joins the islands of an edge that was added.
  void edge_added(const Manifold& m);
  /// Splits the island of an edge that is no longer in the graph, if it fell apart. Returns the edges followed.
  Offset edge_removed(const BodyGraph& graph, Index a, Index b);
  /// Counts `change` more contacts for a manifold.
  void count_contacts(const BodyGraph& graph, const Manifold& m, Offset change);
  void rebuild(const BodyGraph& graph);

  [[nodiscard]] Index slot(Index body) const { return slot_of_body_[at(body)]; }
  [[nodiscard]] const Slots<Island>& islands() const { return islands_; }
  [[nodiscard]] const Tally& sizes() const { return sizes_; }
  [[nodiscard]] const Tally& contacts() const { return contacts_; }

 private:
  /// One of two searches that take turns.
  struct Search {
    std::vector<Index> bodies;  ///< reached, in order
    std::size_t head = 0;       ///< the one whose manifolds are followed
    std::size_t next = 0;       ///< the next of its manifolds
    std::uint64_t mark = 0;
  };
  enum class Step { searching, met, exhausted };

  void start(Search& search, Index body);
  Step advance(Search& search, std::uint64_t other_mark, const BodyGraph& graph);
  void split_off(const BodyGraph& graph, const std::vector<Index>& bodies);
  Index add_island(Island island);
  void drop_island(Index slot);
  void join(Index a, Index b);

  Slots<Island> islands_;
  std::vector<Index> slot_of_body_;   ///< -1: fixed or absent
  std::vector<std::uint64_t> marks_;  ///< which search reached each body last
  std::uint64_t last_mark_ = 0;
  Tally sizes_, contacts_;
  std::array<Search, 2> searches_;
};

}  // namespace stiction::graph
