#pragma once

#include <vector>

#include "stiction/contact_graph.hpp"

namespace stiction::graph {

/// An edge by the positions of its bodies in their island.
struct LocalEdge {
  Index a = 0, b = 0;
  Index contact_count = 0, color = 0;
};

/// Contacts of a moving body, by its position in its island, with a fixed one.
struct FixedEdge {
  Index a = 0;
  Index fixed_body = kWorldBody;
  Index contact_count = 0, color = 0;
};

/// One island with its members, as drawings and spectra need it.
struct IslandEdges {
  std::vector<Index> bodies;  ///< ascending
  Offset contact_count = 0;
  std::vector<LocalEdge> edges;   ///< by pair
  std::vector<FixedEdge> ground;  ///< by fixed body, then moving body, as manifolds() lists pairs
};

/// The islands by number.
std::vector<IslandEdges> edges_by_island(const ContactGraph& graph);

}  // namespace stiction::graph
