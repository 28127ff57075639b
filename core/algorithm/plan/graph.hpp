#pragma once

#include "core/algorithm/plan/sort_network.hpp"
#include "core/algorithm/plan/structure.hpp"
#include "core/team/scan.hpp"

namespace stiction::inline STICTION_ISA {

/// Which cones are swept as one (vertices) and which of those may not be swept at once (conflicts), in one piece of
/// memory. Vertex v conflicts with those it stores an entry with: `stored`, sorted. It also conflicts with those that
/// store one with it though it stores none with them: `mirrored`. No vertex is in both.
struct ConflictGraph {
  Index vertices = 0;
  Index* cones;           ///< by vertex                                                          (cones)
  Index* vertex_begin;    ///< where in `cones` each vertex begins, closed by the cone count      (cones + 1)
  Index* row_vertex;      ///< vertex of each row                                                 (rows)
  Index* stored_begin;    ///< where each vertex's part of `stored` begins, where its entries do  (cones)
  Index* stored_count;    ///< how many are in it                                                 (cones)
  Index* stored;          ///<                                                                    (entry span)
  Index* mirrored_begin;  ///< where each vertex's part of `mirrored` begins, and ends            (cones + 1)
  Index* mirrored;        ///<                                                                    (entry span)
  Index* degree;          ///< neighbours of either sort                                          (cones)
  Index* parts;           ///< for scans                                                          (kScanParts)

  static STICTION_HD constexpr Offset elements(Offset rows, Offset cones, Offset entry_span) {
    return 2 * (cones + 1) + 4 * cones + rows + 2 * entry_span + kScanParts;
  }

  STICTION_HD ConflictGraph(const StructureView& s, Index* memory) {
    const auto take = [&](Index*& array, Offset count) {
      array = memory;
      memory += count;
    };
    take(cones, s.cones);
    take(vertex_begin, Offset{s.cones} + 1);
    take(row_vertex, s.rows);
    take(stored_begin, s.cones);
    take(stored_count, s.cones);
    take(stored, s.entry_span());
    take(mirrored_begin, Offset{s.cones} + 1);
    take(mirrored, s.entry_span());
    take(degree, s.cones);
    take(parts, kScanParts);
  }

  /// visit(u) for every neighbour of v until one returns false; whether none did.
  template <class Visit>
  STICTION_HD bool all_neighbours(Index v, Visit&& visit) const {
    const Index* const own = stored + stored_begin[v];
    for (Index k = 0; k < stored_count[v]; ++k)
      if (!visit(own[k])) return false;
    for (Index k = mirrored_begin[v]; k < mirrored_begin[v + 1]; ++k)
      if (!visit(mirrored[k])) return false;
    return true;
  }
};

/// Returns true if sorted values contain this one.
STICTION_HD bool has_value(const Index* sorted, Index count, Index value) {
  const Index place = lower_bound(sorted, count, value, [](Index a, Index b) { return a < b; });
  return place < count && sorted[place] == value;
}

/// A block is one vertex. Without blocks neighbouring cones of one non-negative group are one, any other cone is a
/// separate one.
template <Team TeamT>
STICTION_HD void find_vertices(TeamT& team, const StructureView& s, ConflictGraph& graph) {
  for_each(team, s.cones, [&](Index cone) { graph.cones[s.has_blocks ? place_of(s.group[cone]) : cone] = cone; });
  const auto begins = [&](Index place) {
    const Index cone = graph.cones[place];
    if (s.has_blocks) return place == 0 || begins_block(s.group[cone]);
    return cone == 0 || s.group == nullptr || s.group[cone] < 0 || s.group[cone] != s.group[cone - 1];
  };
  Index* const before = graph.degree;
  Index* const room = graph.mirrored_begin;
  for_each(team, s.cones, [&](Index place) {
    const Index cone = graph.cones[place];
    before[place] = begins(place) ? 1 : 0;
    room[place] = s.entry_begin(s.cone_row(cone + 1)) - s.entry_begin(s.cone_row(cone));
  });
  graph.vertices = exclusive_scan(team, before, s.cones, graph.parts);
  exclusive_scan(team, room, s.cones, graph.parts);
  for_each(team, s.cones, [&](Index place) {
    const Index vertex = begins(place) ? before[place] : before[place] - 1;
    if (begins(place)) {
      graph.vertex_begin[vertex] = place;
      graph.stored_begin[vertex] = room[place];
    }
    const Index cone = graph.cones[place];
    const Index end = s.cone_row(cone + 1);
    for (Index i = s.cone_row(cone); i < end; ++i) graph.row_vertex[i] = vertex;
  });
  single(team, [&] { graph.vertex_begin[graph.vertices] = s.cones; });
}

/// The vertices that v stores entries with, each once, in order, without v; returns how many. The rows of a vertex
/// mostly store equal columns in order. There the first row makes the list and the others find it made.
STICTION_HD Index gather_stored(const StructureView& s, const ConflictGraph& graph, Index v) {
  Index* const list = graph.stored + graph.stored_begin[v];
  Index count = 0, sorted = 0;
  const auto gather = [&](Index row) {
    const Index* const columns = s.columns(row);
    const Index entries = s.entries(row);
    for (Index k = 0; k < entries; ++k) {
      const Index u = graph.row_vertex[columns[k]];
      if (u == v || has_value(list, sorted, u)) continue;
      const bool goes_on = count == sorted && (count == 0 || list[count - 1] < u);
      list[count++] = u;
      if (goes_on) sorted = count;
    }
  };
  for (Index place = graph.vertex_begin[v]; place < graph.vertex_begin[v + 1]; ++place) {
    const Index end = s.cone_row(graph.cones[place] + 1);
    for (Index row = s.cone_row(graph.cones[place]); row < end; ++row) gather(row);
  }
  if (sorted == count) return count;
  SerialTeam alone;
  sort_network(alone, count, list, [](Index a, Index b) { return a < b; });
  Index kept = 1;
  for (Index k = 1; k < count; ++k)
    if (list[k] != list[kept - 1]) list[kept++] = list[k];
  return kept;
}

/// Fills `mirrored`: a counting transposition by one lane, of nothing but the entries that lack their mirror. Few
/// systems have any.
template <Team TeamT>
STICTION_HD_OUTLINE void mirror_conflicts(TeamT& team, ConflictGraph& graph) {
  const auto lacks = [&](Index v, Index u) {
    return !has_value(graph.stored + graph.stored_begin[u], graph.stored_count[u], v);
  };
  // Marked in `mirrored` first, since others are still searching the lists; then in the lists, as ~u.
  std::uint32_t lopsided = 0;
  for_each(team, graph.vertices, [&](Index v) {
    for (Index k = 0; k < graph.stored_count[v]; ++k) {
      const Index place = graph.stored_begin[v] + k;
      const bool marked = lacks(v, graph.stored[place]);
      graph.mirrored[place] = marked ? 1 : 0;
      lopsided |= static_cast<std::uint32_t>(marked);
    }
  });
  for_each(team, graph.vertices + 1, [&](Index v) { graph.mirrored_begin[v] = 0; });
  if (team.combine(lopsided) == 0) return;

  const auto each_place = [&](Index v, const auto& visit) {
    for (Index k = 0; k < graph.stored_count[v]; ++k) visit(graph.stored_begin[v] + k);
  };
  for_each(team, graph.vertices, [&](Index v) {
    each_place(v, [&](Index k) {
      if (graph.mirrored[k] != 0) graph.stored[k] = ~graph.stored[k];
    });
  });
  single(team, [&] {
    for (Index v = 0; v < graph.vertices; ++v)
      each_place(v, [&](Index k) {
        if (graph.stored[k] < 0) ++graph.mirrored_begin[~graph.stored[k]];
      });
  });
  exclusive_scan(team, graph.mirrored_begin, graph.vertices + 1, graph.parts);
  Index* const next = graph.degree;
  for_each(team, graph.vertices, [&](Index v) { next[v] = graph.mirrored_begin[v]; });
  single(team, [&] {
    for (Index v = 0; v < graph.vertices; ++v)
      each_place(v, [&](Index k) {
        if (graph.stored[k] < 0) graph.mirrored[next[~graph.stored[k]]++] = v;
      });
  });
  for_each(team, graph.vertices, [&](Index v) {
    each_place(v, [&](Index k) {
      if (graph.stored[k] < 0) graph.stored[k] = ~graph.stored[k];
    });
  });
}

/// The vertices of an environment and their conflicts. A conflict is any stored entry, whatever its value, that joins
/// a row of one with a row of the other either way round.
template <Team TeamT>
STICTION_HD ConflictGraph find_conflicts(TeamT& team, const StructureView& s, Index* memory) {
  ConflictGraph graph(s, memory);
  find_vertices(team, s, graph);
  for_each(team, graph.vertices, [&](Index v) { graph.stored_count[v] = gather_stored(s, graph, v); });
  mirror_conflicts(team, graph);
  for_each(team, graph.vertices, [&](Index v) {
    graph.degree[v] = graph.stored_count[v] + graph.mirrored_begin[v + 1] - graph.mirrored_begin[v];
  });
  return graph;
}

}  // namespace stiction::inline STICTION_ISA
