#include <algorithm>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/graph/island_edges.hpp"
#include "core/graph/slots.hpp"
#include "core/graph/tridiagonal.hpp"
#include "stiction/contact_graph.hpp"
#include "stiction/error.hpp"

namespace stiction {

std::vector<double> laplacian_spectrum(const ContactGraph& graph) {
  const ScopedFpEnv fp_env;
  if (graph.statistics().largest_island > kMaxSpectrumBodies)
    throw Error(ErrorCode::unsupported, "an island has " + std::to_string(graph.statistics().largest_island) +
                                            " bodies: the spectrum is computed for islands of up to " +
                                            std::to_string(kMaxSpectrumBodies));
  std::vector<double> spectrum;
  for (const graph::IslandEdges& island : graph::edges_by_island(graph)) {
    const std::size_t n = island.bodies.size();
    std::vector<double> laplacian(n * n, 0.0);
    for (const graph::LocalEdge& edge : island.edges) {
      const auto i = graph::at(edge.a), j = graph::at(edge.b);
      laplacian[i * n + i] += edge.contact_count;
      laplacian[j * n + j] += edge.contact_count;
      laplacian[i * n + j] -= edge.contact_count;
      laplacian[j * n + i] -= edge.contact_count;
    }
    const graph::Tridiagonal T = graph::tridiagonalise(std::move(laplacian), n);
    const double bound = graph::reach(T);
    for (std::size_t rank = 0; rank < n; ++rank) spectrum.push_back(graph::eigenvalue(T, rank, -bound, bound));
  }
  std::sort(spectrum.begin(), spectrum.end());
  return spectrum;
}

}  // namespace stiction
