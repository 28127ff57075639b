#pragma once

#include "core/algorithm/plan/color.hpp"
#include "core/algorithm/plan/cones.hpp"

namespace stiction::inline STICTION_ISA {

/// Destination of one environment's plan; shapes and meaning as in PlanData (core/plan/plan.hpp).
struct PlanTarget {
  EnvPath* path;          ///<                                                                  (1)
  ConeCounts* counts;     ///<                                                                  (1)
  Index* cone_order;      ///<                                                                  (cones)
  Index* vertex_offsets;  ///< written by a sparse environment; room for                        (cones + 1)
  Index* color_offsets;   ///< written by a sparse environment; room for                        (cones + 1)
  Index* color_count;     ///<                                                                  (1)
};

/// Work memory of plan_sparse(), in Index: 258 + rows + 9 cones + 2 entry_span. entry_span is the room of an
/// environment's stored entries, row_offsets of its last row's end less that of its first row.
STICTION_HD constexpr Offset plan_scratch_elements(Offset rows, Offset cones, Offset entry_span) {
  return ConflictGraph::elements(rows, cones, entry_span) + 3 * cones;
}

/// Vertices by colour; in a colour by kind of the first cone, rows and index, so that neighbouring lanes run the same
/// code.
template <Team TeamT>
STICTION_HD void order_vertices(TeamT& team, const StructureView& s, const ConflictGraph& graph, const Index* color,
                                Index* order) {
  const auto kind = [&](Index v) { return s.kind[graph.cones[graph.vertex_begin[v]]]; };
  const auto rows = [&](Index v) {
    Index sum = 0;
    for (Index p = graph.vertex_begin[v]; p < graph.vertex_begin[v + 1]; ++p) sum += s.cone_size(graph.cones[p]);
    return sum;
  };
  for_each(team, graph.vertices, [&](Index v) { order[v] = v; });
  sort_network(team, graph.vertices, order, [&](Index u, Index v) {
    if (color[u] != color[v]) return color[u] < color[v];
    if (kind(u) != kind(v)) return kind(u) < kind(v);
    return rows(u) != rows(v) ? rows(u) < rows(v) : u < v;
  });
}

/// Plans a sparse environment; `scratch` has room for plan_scratch_elements().
template <Team TeamT>
STICTION_HD_OUTLINE void plan_sparse(TeamT& team, const StructureView& s, const PlanTarget& plan, Index* scratch) {
  const ConflictGraph graph = find_conflicts(team, s, scratch);
  Index* const color = scratch + ConflictGraph::elements(s.rows, s.cones, s.entry_span());
  Index* const next = color + s.cones;
  Index* const order = next + s.cones;
  color_vertices(team, graph, color, next, order);
  order_vertices(team, s, graph, color, order);

  const auto cones_of = [&](Index v) { return graph.vertex_begin[v + 1] - graph.vertex_begin[v]; };
  for_each(team, graph.vertices, [&](Index p) { plan.vertex_offsets[p] = cones_of(order[p]); });
  exclusive_scan(team, plan.vertex_offsets, graph.vertices, graph.parts);
  for_each(team, graph.vertices, [&](Index p) {
    const Index v = order[p];
    for (Index c = 0; c < cones_of(v); ++c)
      plan.cone_order[plan.vertex_offsets[p] + c] = graph.cones[graph.vertex_begin[v] + c];
    if (p == 0 || color[order[p - 1]] != color[v]) plan.color_offsets[color[v]] = p;
  });
  const ConeCounts counts = count_cones(team, s, graph.parts);
  single(team, [&] {
    const Index colors = color[order[graph.vertices - 1]] + 1;
    plan.vertex_offsets[graph.vertices] = s.cones;
    plan.color_offsets[colors] = graph.vertices;
    *plan.color_count = colors;
    *plan.counts = counts;
  });
}

/// Plans one environment whose structure is sound: the same integers as make_plan(), by however many lanes. `scratch`
/// has room for plan_scratch_elements() if it is sparse, and is not read otherwise.
template <Team TeamT>
STICTION_HD void plan_environment(TeamT& team, const StructureView& s, const PlanTarget& plan, Index* scratch) {
  const EnvPath path = path_of(team, s);
  single(team, [&] { *plan.path = path; });
  if (path == EnvPath::sparse) {
    plan_sparse(team, s, plan, scratch);
  } else {
    plan_dense(team, s, plan.counts, plan.cone_order);
    single(team, [&] { *plan.color_count = 0; });
  }
}

}  // namespace stiction::inline STICTION_ISA
