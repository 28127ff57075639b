#include "core/base/fp_env.hpp"
#include "core/graph/island_edges.hpp"
#include "core/graph/slots.hpp"
#include "core/graph/text.hpp"
#include "stiction/contact_graph.hpp"

namespace stiction {
namespace {

std::string edge_text(const std::string& from, const std::string& to, Index contact_count, Index color) {
  const std::string count = std::to_string(contact_count);
  return "    " + from + " -- " + to + " [label=\"" + count + "\" weight=" + count + " color=\"" +
         graph::color_hex(color) + "\" tooltip=\"" + graph::counted(contact_count, "contact", "contacts") +
         ", colour " + std::to_string(color) + "\"]\n";
}

std::string cluster_text(const graph::IslandEdges& island) {
  const auto name = [&](Index position) { return std::to_string(island.bodies[graph::at(position)]); };
  const std::string number = std::to_string(island.bodies.front());
  std::string text = "  subgraph cluster_" + number + " {\n    label=\"island " + number + ": " +
                     graph::counted(static_cast<Offset>(island.bodies.size()), "body", "bodies") + ", " +
                     graph::counted(island.contact_count, "contact", "contacts") +
                     "\" fontsize=10 color=\"#888888\" style=rounded\n";
  for (const Index body : island.bodies) text += "    " + std::to_string(body) + "\n";
  for (const graph::LocalEdge& edge : island.edges)
    text += edge_text(name(edge.a), name(edge.b), edge.contact_count, edge.color);
  for (const graph::FixedEdge& edge : island.ground) {
    const bool world = edge.fixed_body == kWorldBody;
    const std::string label = world ? "world" : std::to_string(edge.fixed_body);
    const std::string square = "\"" + label + " at " + name(edge.a) + "\"";
    text += "    " + square + " [label=\"" + label + "\" shape=box style=filled fillcolor=\"#dddddd\" fontsize=8]\n";
    text += edge_text(name(edge.a), square, edge.contact_count, edge.color);
  }
  return text + "  }\n";
}

}  // namespace

std::string to_dot(const ContactGraph& graph, const std::string& title) {
  const ScopedFpEnv fp_env;
  std::string text = "graph contacts {\n  graph [label=\"" + graph::escape_dot(title) +
                     "\" labelloc=t fontname=\"Helvetica\" overlap=false splines=line outputorder=edgesfirst]\n"
                     "  node [shape=circle style=filled fillcolor=white fontname=\"Helvetica\" fontsize=10 "
                     "width=0.3 height=0.2 margin=0.03]\n"
                     "  edge [penwidth=2 fontname=\"Helvetica\" fontsize=8]\n";
  for (const graph::IslandEdges& island : graph::edges_by_island(graph)) text += cluster_text(island);
  return text + "}\n";
}

}  // namespace stiction
