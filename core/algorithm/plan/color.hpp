#pragma once

#include "core/algorithm/plan/graph.hpp"
#include "core/job/plan_view.hpp"

namespace stiction::inline STICTION_ISA {

/// Rounds in which all lanes colour whatever may be coloured. Vertices still waiting after them hang on a long chain,
/// and one lane goes through it faster. The colours are the same either way.
inline constexpr Index kColorRounds = 64;

/// The smallest colour that no neighbour of v has, in windows of 64: nothing bounds the number of colours.
STICTION_HD Index smallest_free_color(const ConflictGraph& graph, const Index* color, Index v) {
  for (Index first = 0;; first += 64) {
    std::uint64_t taken = 0;
    graph.all_neighbours(v, [&](Index u) {
      const Index place = color[u] - first;
      if (color[u] != kUncolored && place >= 0 && place < 64) taken |= std::uint64_t{1} << place;
      return true;
    });
    if (taken == ~std::uint64_t{0}) continue;
    Index free = first;
    for (; (taken & 1) != 0; taken >>= 1) ++free;
    return free;
  }
}

/// Colours the vertices as color_graph() does: greedily, the largest degree first, the smaller index first among
/// equals. A vertex can be coloured once all its neighbours that come before it are, whatever else is. (Jones and
/// Plassmann 1993, with degrees for random numbers.) Every round thus colours many, and the outcome is the sequential
/// one. `next` and `order` have room for every vertex.
template <Team TeamT>
STICTION_HD_OUTLINE void color_vertices(TeamT& team, const ConflictGraph& graph, Index* color, Index* next,
                                        Index* order) {
  const auto comes_before = [&](Index u, Index v) {
    return graph.degree[u] != graph.degree[v] ? graph.degree[u] > graph.degree[v] : u < v;
  };
  const auto is_ready = [&](Index v) {
    return graph.all_neighbours(v, [&](Index u) { return color[u] != kUncolored || !comes_before(u, v); });
  };
  for_each(team, graph.vertices, [&](Index v) { color[v] = kUncolored; });
  bool waiting = true;
  for (Index round = 0; waiting && team.size() > 1 && round < kColorRounds; ++round) {
    std::uint32_t left = 0;
    for_each(team, graph.vertices, [&](Index v) {
      next[v] = color[v] == kUncolored && is_ready(v) ? smallest_free_color(graph, color, v) : color[v];
      left |= static_cast<std::uint32_t>(next[v] == kUncolored);
    });
    for_each(team, graph.vertices, [&](Index v) { color[v] = next[v]; });
    waiting = team.combine(left) != 0;
  }
  if (!waiting) return;

  for_each(team, graph.vertices, [&](Index v) { order[v] = v; });
  sort_network(team, graph.vertices, order, comes_before);
  single(team, [&] {
    for (Index p = 0; p < graph.vertices; ++p) {
      const Index v = order[p];
      if (color[v] == kUncolored) color[v] = smallest_free_color(graph, color, v);
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
