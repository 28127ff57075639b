#include "cli/cone_graph.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/plan/color.hpp"
#include "stiction/status.hpp"

namespace stiction::cli {

namespace {

std::size_t at(Offset i) {
  return static_cast<std::size_t>(i);
}

std::vector<Index> cone_of_row(const ContactBatchView<double>& batch, Offset env) {
  std::vector<Index> cones;
  const Offset first = batch.env_cone_offsets[env];
  for (Offset cone = first; cone < batch.env_cone_offsets[env + 1]; ++cone) {
    const Offset rows = batch.cone_row_offsets[cone + 1] - batch.cone_row_offsets[cone];
    cones.insert(cones.end(), at(rows), static_cast<Index>(cone - first));
  }
  return cones;
}

/// Breadth-first from every cone not yet reached, so islands are numbered by their first cones.
void find_islands(ConeGraph& graph) {
  std::vector<Index> queue;
  for (std::size_t seed = 0; seed < graph.island.size(); ++seed) {
    if (graph.island[seed] >= 0) continue;
    graph.island[seed] = graph.island_count;
    queue.assign(1, static_cast<Index>(seed));
    for (std::size_t head = 0; head < queue.size(); ++head) {
      const std::size_t cone = at(queue[head]);
      for (Index k = graph.offsets[cone]; k < graph.offsets[cone + 1]; ++k) {
        const Index other = graph.neighbours[at(k)];
        if (graph.island[at(other)] >= 0) continue;
        graph.island[at(other)] = graph.island_count;
        queue.push_back(other);
      }
    }
    ++graph.island_count;
  }
}

/// Hues a golden ratio apart: neighbours in the order of colours are far apart on the wheel.
std::string fill(Index color) {
  const double hue = std::fmod(0.08 + 0.6180339887498949 * color, 1.0);
  return fmt::format("{:.4f} {:.2f} 0.95", hue, color % 2 == 0 ? 0.45 : 0.75);
}

const char* shape(ConeKind kind) {
  switch (kind) {
    case ConeKind::free:
      return "diamond";
    case ConeKind::unilateral:
      return "triangle";
    case ConeKind::box:
      return "box";
    case ConeKind::friction:
      return "circle";
    case ConeKind::box_friction:
      return "square";
    case ConeKind::semidefinite:
      return "hexagon";
  }
  return "circle";
}

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '"' || c == '\\') safe += '\\';
    safe += c;
  }
  return safe;
}

}  // namespace

ConeGraph make_cone_graph(const ContactBatchView<double>& batch, Offset env) {
  const std::vector<Index> cone_of = cone_of_row(batch, env);
  const Offset first_row = batch.env_row_offsets[env];
  const auto cones = at(batch.env_cone_offsets[env + 1] - batch.env_cone_offsets[env]);
  std::vector<std::vector<Index>> adjacent(cones);
  for (std::size_t row = 0; row < cone_of.size(); ++row) {
    const Offset r = first_row + static_cast<Offset>(row);
    for (Offset k = batch.row_offsets[r]; k < batch.row_offsets[r + 1]; ++k) {
      const Index i = cone_of[row];
      const Index j = cone_of[at(batch.column[k])];
      if (i == j || batch.A[k] == 0) continue;
      adjacent[at(i)].push_back(j);
      adjacent[at(j)].push_back(i);
    }
  }
  ConeGraph graph;
  for (std::vector<Index>& list : adjacent) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    graph.neighbours.insert(graph.neighbours.end(), list.begin(), list.end());
    graph.offsets.push_back(static_cast<Index>(graph.neighbours.size()));
  }
  graph.island.assign(cones, -1);
  find_islands(graph);
  return graph;
}

std::vector<Index> cone_colors(const ConeGraph& graph, const ContactBatchView<double>& batch, const PlanData& plan,
                               Offset env) {
  if (plan.path[at(env)] != EnvPath::sparse) return color_graph(graph.offsets, graph.neighbours).color;
  std::vector<Index> colors(at(graph.cone_count()), 0);
  const Index* order = plan.cone_order.data() + batch.env_cone_offsets[env];
  const Index* vertex_offsets = plan.vertex_offsets.data() + plan.env_vertex_offsets[at(env)];
  const Offset first = plan.env_color_offsets[at(env)];
  const Index color_count = plan.color_count[at(env)];
  for (Index color = 0; color < color_count; ++color) {
    const Index begin = vertex_offsets[plan.color_offsets[at(first + color)]];
    const Index end = vertex_offsets[plan.color_offsets[at(first + color + 1)]];
    for (Index position = begin; position < end; ++position) colors[at(order[position])] = color;
  }
  return colors;
}

std::string to_dot(const ConeGraph& graph, const ContactBatchView<double>& batch, Offset env,
                   const std::vector<Index>& colors, const std::string& title) {
  const Offset first_cone = batch.env_cone_offsets[env];
  std::vector<std::string> islands(at(graph.island_count));
  for (Index cone = 0; cone < graph.cone_count(); ++cone) {
    const ConeKind kind = batch.cone_kind[first_cone + cone];
    islands[at(graph.island[at(cone)])] +=
        fmt::format("    {} [shape={} fillcolor=\"{}\" tooltip=\"cone {}: {}, colour {}\"]\n", cone, shape(kind),
                    fill(colors[at(cone)]), cone, to_string(kind), colors[at(cone)]);
  }
  std::string dot = "graph contacts {\n";
  dot += fmt::format(
      "  graph [label=\"{}\" labelloc=t fontname=\"Helvetica\" overlap=false splines=line outputorder=edgesfirst]\n",
      escaped(title));
  dot += "  node [style=filled fontname=\"Helvetica\" fontsize=10 width=0.35 height=0.35 fixedsize=true]\n";
  dot += "  edge [color=\"#00000055\"]\n";
  for (std::size_t island = 0; island < islands.size(); ++island) {
    dot += fmt::format(
        "  subgraph cluster_{} {{\n    label=\"island {}\" fontsize=9 color=\"#888888\" style=rounded\n{}  }}\n",
        island, island, islands[island]);
  }
  for (Index cone = 0; cone < graph.cone_count(); ++cone) {
    for (Index k = graph.offsets[at(cone)]; k < graph.offsets[at(cone) + 1]; ++k) {
      const Index other = graph.neighbours[at(k)];
      if (other > cone) dot += fmt::format("  {} -- {}\n", cone, other);
    }
  }
  return dot + "}\n";
}

}  // namespace stiction::cli
