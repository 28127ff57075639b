#pragma once

#include <string>
#include <vector>

#include "core/plan/plan.hpp"
#include "stiction/batch.hpp"

namespace stiction::cli {

/// The contact graph of one environment: its cones, joined where an entry of A that is not zero couples their rows,
/// in either triangle.
struct ConeGraph {
  std::vector<Index> offsets{0};  ///< (cones + 1)
  std::vector<Index> neighbours;  ///< ascending, each edge at both ends, no loops
  std::vector<Index> island;      ///< connected component, numbered by their first cones (cones)
  Index island_count = 0;

  [[nodiscard]] Index cone_count() const { return static_cast<Index>(island.size()); }
  [[nodiscard]] std::size_t edge_count() const { return neighbours.size() / 2; }
};

ConeGraph make_cone_graph(const ContactBatchView<double>& batch, Offset env);

/// Colour of every cone. It is the plan's where the environment is solved colour by colour. Else it is a colouring of
/// the graph itself (dense environments are swept in canonical order and need none).
std::vector<Index> cone_colors(const ConeGraph& graph, const ContactBatchView<double>& batch, const PlanData& plan,
                               Offset env);

/// The graph in Graphviz' language: cones filled with their colours, islands boxed, `title` above.
std::string to_dot(const ConeGraph& graph, const ContactBatchView<double>& batch, Offset env,
                   const std::vector<Index>& colors, const std::string& title);

}  // namespace stiction::cli
