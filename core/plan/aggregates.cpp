#include "core/plan/aggregates.hpp"

#include <algorithm>
#include <span>

#include "core/base/extents.hpp"

namespace stiction {
namespace {

std::span<const Index> row_of(const BlockPattern& graph, Index body) {
  return {graph.columns + graph.offsets[body], graph.columns + graph.offsets[body + 1]};
}

}  // namespace

Aggregates find_aggregates(const BlockPattern& graph) {
  Aggregates found;
  std::vector<Index>& aggregate = found.aggregate;
  aggregate.assign(at(graph.rows), -1);
  for (Index body = 0; body < graph.rows; ++body) {
    const std::span<const Index> row = row_of(graph, body);
    const bool is_root = row.size() > 1 && std::all_of(row.begin(), row.end(),
                                                       [&](Index neighbour) { return aggregate[at(neighbour)] < 0; });
    if (!is_root) continue;
    for (const Index neighbour : row) aggregate[at(neighbour)] = static_cast<Index>(found.root.size());
    found.root.push_back(body);
  }
  // The others consider the roots' aggregates alone, so that the order in which they join does not matter.
  const std::vector<Index> taken = aggregate;
  std::vector<Index> shared(found.root.size(), 0);
  for (Index body = 0; body < graph.rows; ++body) {
    const std::span<const Index> row = row_of(graph, body);
    if (taken[at(body)] >= 0 || row.size() <= 1) continue;
    Index best = -1;
    for (const Index neighbour : row) {
      const Index joined = taken[at(neighbour)];
      if (joined < 0) continue;
      const Index count = ++shared[at(joined)];
      const Index most = best < 0 ? 0 : shared[at(best)];
      if (count > most || (count == most && joined < best)) best = joined;
    }
    aggregate[at(body)] = best;
    for (const Index neighbour : row)
      if (taken[at(neighbour)] >= 0) shared[at(taken[at(neighbour)])] = 0;
  }
  return found;
}

}  // namespace stiction
