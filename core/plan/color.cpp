#include "core/plan/color.hpp"

#include "core/base/extents.hpp"
#include "core/job/plan_view.hpp"

namespace stiction {
namespace {

/// Vertices by decreasing degree, ties by index: a counting sort, which is stable and never compares.
std::vector<Index> largest_degree_first(std::span<const Index> offsets, Index vertex_count) {
  Index max_degree = 0;
  for (Index v = 0; v < vertex_count; ++v) max_degree = larger_of(max_degree, offsets[at(v + 1)] - offsets[at(v)]);

  // Bucket of a degree: max_degree - degree, so that the largest comes first.
  const auto bucket = [&](Index v) { return at(max_degree - (offsets[at(v + 1)] - offsets[at(v)])); };
  std::vector<Index> begin(at(max_degree) + 2, 0);
  for (Index v = 0; v < vertex_count; ++v) ++begin[bucket(v) + 1];
  for (std::size_t d = 1; d < begin.size(); ++d) begin[d] += begin[d - 1];

  std::vector<Index> order(at(vertex_count));
  for (Index v = 0; v < vertex_count; ++v) order[at(begin[bucket(v)]++)] = v;
  return order;
}

}  // namespace

Coloring color_graph(std::span<const Index> offsets, std::span<const Index> neighbours) {
  const Index vertex_count = offsets.empty() ? 0 : static_cast<Index>(offsets.size()) - 1;
  Coloring result;
  result.color.assign(at(vertex_count), kUncolored);

  // taken_by[c] == v: a neighbour of v has colour c. Stamps need no clearing between vertices, which keeps the
  // whole loop linear in the edges. One more colour than there are so far is always free.
  std::vector<Index> taken_by(1, kUncolored);
  for (const Index v : largest_degree_first(offsets, vertex_count)) {
    for (Index k = offsets[at(v)]; k < offsets[at(v + 1)]; ++k) {
      const Index neighbour_color = result.color[at(neighbours[at(k)])];
      if (neighbour_color != kUncolored) taken_by[at(neighbour_color)] = v;
    }
    Index color = 0;
    while (taken_by[at(color)] == v) ++color;
    result.color[at(v)] = color;
    if (color == result.color_count) {
      ++result.color_count;
      taken_by.push_back(kUncolored);
    }
  }
  return result;
}

}  // namespace stiction
