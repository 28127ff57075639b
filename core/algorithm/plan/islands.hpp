#pragma once

#include "core/algorithm/plan/graph.hpp"

namespace stiction::inline STICTION_ISA {

/// Rounds in which labels spread and jump; one lane settles the others then.
inline constexpr Index kIslandRounds = 32;

/// Returns the end of a chain of ever smaller labels.
STICTION_HD Index root_of_label(const Index* label, Index v) {
  while (label[v] != v) v = label[v];
  return v;
}

/// Every vertex's label becomes the smallest vertex of its island, unless that takes more rounds than allowed; returns
/// true if it did. A label is always a vertex of the same island and never larger than its owner, so it may be
/// replaced by its own label. Chains of n vertices in order take log n rounds. (As Shiloach and Vishkin 1982, but
/// every vertex pulls from its neighbours, so that no two lanes write one label.)
template <Team TeamT>
STICTION_HD bool spread_labels(TeamT& team, const ConflictGraph& graph, Index* label, Index* next) {
  for_each(team, graph.vertices, [&](Index v) { label[v] = v; });
  for (Index round = 0; team.size() > 1 && round < kIslandRounds; ++round) {
    std::uint32_t changed = 0;
    for_each(team, graph.vertices, [&](Index v) {
      Index smallest = label[v];
      graph.all_neighbours(v, [&](Index u) {
        if (label[u] < smallest) smallest = label[u];
        return true;
      });
      changed |= static_cast<std::uint32_t>(smallest != label[v]);
      next[v] = smallest;
    });
    for_each(team, graph.vertices, [&](Index v) { label[v] = next[next[v]]; });
    if (team.combine(changed) == 0) return true;
  }
  return false;
}

/// Unites labels by one lane, from labels spread as far as they are: union by smaller vertex, halving paths.
template <Team TeamT>
STICTION_HD void unite_labels(TeamT& team, const ConflictGraph& graph, Index* label, Index* next) {
  const auto find = [&](Index v) {
    while (label[v] != v) {
      label[v] = label[label[v]];
      v = label[v];
    }
    return v;
  };
  single(team, [&] {
    for (Index v = 0; v < graph.vertices; ++v) {
      for (Index k = 0; k < graph.stored_count[v]; ++k) {
        const Index a = find(v), b = find(graph.stored[graph.stored_begin[v] + k]);
        if (a < b) label[b] = a;
        if (b < a) label[a] = b;
      }
    }
  });
  for_each(team, graph.vertices, [&](Index v) { next[v] = root_of_label(label, v); });
  for_each(team, graph.vertices, [&](Index v) { label[v] = next[v]; });
}

/// Work memory of number_islands(), in Index.
STICTION_HD constexpr Offset islands_scratch_elements(Offset rows, Offset cones, Offset entry_span) {
  return ConflictGraph::elements(rows, cones, entry_span) + 2 * cones;
}

/// Finds the islands of one environment whose structure is sound, on any path. island[c] of each cone counts 0, 1, ...
/// by their first cones, as find_islands() of core/plan/islands.hpp does. Returns how many, on every lane; `scratch`
/// has room for islands_scratch_elements().
template <Team TeamT>
STICTION_HD_OUTLINE Index number_islands(TeamT& team, const StructureView& s, Index* island, Index* scratch) {
  const ConflictGraph graph = find_conflicts(team, s, scratch);
  Index* const label = scratch + ConflictGraph::elements(s.rows, s.cones, s.entry_span());
  Index* const number = label + s.cones;
  if (!spread_labels(team, graph, label, number)) unite_labels(team, graph, label, number);
  for_each(team, graph.vertices, [&](Index v) { number[v] = label[v] == v ? 1 : 0; });
  const Index count = exclusive_scan(team, number, graph.vertices, graph.parts);
  for_each(team, s.cones, [&](Index c) { island[c] = number[label[graph.row_vertex[s.cone_row(c)]]]; });
  return count;
}

}  // namespace stiction::inline STICTION_ISA
