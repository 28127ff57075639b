#include "core/graph/island_edges.hpp"

#include <unordered_map>
#include <utility>

#include "core/graph/slots.hpp"

namespace stiction::graph {

std::vector<IslandEdges> edges_by_island(const ContactGraph& graph) {
  std::vector<IslandEdges> islands;
  std::unordered_map<Index, std::pair<std::size_t, Index>> place;  // of a moving body: island, position
  for (GraphIsland& island : graph.islands()) {
    for (std::size_t i = 0; i < island.bodies.size(); ++i)
      place[island.bodies[i]] = {islands.size(), static_cast<Index>(i)};
    islands.push_back({std::move(island.bodies), island.contact_count, {}, {}});
  }
  for (const GraphManifold& m : graph.manifolds()) {
    const auto a = place.find(m.body_a), b = place.find(m.body_b);
    if (a != place.end() && b != place.end()) {
      islands[a->second.first].edges.push_back({a->second.second, b->second.second, m.contact_count, m.color});
    } else {
      const auto& [island, position] = a != place.end() ? a->second : b->second;
      islands[island].ground.push_back({position, a != place.end() ? m.body_b : m.body_a, m.contact_count, m.color});
    }
  }
  return islands;
}

}  // namespace stiction::graph
