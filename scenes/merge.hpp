#pragma once

#include <vector>

#include "scenes/rng.hpp"
#include "stiction/batch.hpp"

/// Systems that know nothing of one another, in one environment.
namespace stiction::scenes {

struct Merged {
  Environment<double> system;
  std::vector<std::vector<Index>> rows;  ///< rows[s][i]: where row i of system s is
};

/// The cones of all systems, each system's in their order, dealt out at random. Stored entries keep their order in each
/// row, and manifolds of different systems get different ids.
inline Merged merge(const std::vector<Environment<double>>& systems, std::uint64_t seed) {
  const std::size_t count = systems.size();
  Merged merged;
  merged.rows.resize(count);
  struct Taken {
    std::size_t system;
    Index row;
  };
  std::vector<Taken> taken;
  std::vector<std::size_t> next(count, 0), left;
  for (std::size_t s = 0; s < count; ++s)
    if (!systems[s].cones.empty()) left.push_back(s);
  Rng rng(seed);
  while (!left.empty()) {
    const auto pick = static_cast<std::size_t>(rng.below(static_cast<int>(left.size())));
    const std::size_t s = left[pick];
    auto cone = systems[s].cones[next[s]++];
    if (cone.group >= 0) cone.group = cone.group * static_cast<Index>(count) + static_cast<Index>(s);
    merged.system.cones.push_back(cone);
    for (Index k = 0; k < cone.row_count; ++k) {
      taken.push_back({s, static_cast<Index>(merged.rows[s].size())});
      merged.rows[s].push_back(static_cast<Index>(taken.size()) - 1);
    }
    if (next[s] == systems[s].cones.size()) left.erase(left.begin() + static_cast<std::ptrdiff_t>(pick));
  }
  for (const Taken& one : taken) {
    const Environment<double>& from = systems[one.system];
    const auto row = static_cast<std::size_t>(one.row);
    for (Index k = from.row_offsets[row]; k < from.row_offsets[row + 1]; ++k) {
      const auto entry = static_cast<std::size_t>(k);
      merged.system.column.push_back(merged.rows[one.system][static_cast<std::size_t>(from.column[entry])]);
      merged.system.A.push_back(from.A[entry]);
    }
    merged.system.row_offsets.push_back(static_cast<Index>(merged.system.column.size()));
    const auto number = [row](const std::vector<double>& values) { return values.empty() ? 0.0 : values[row]; };
    merged.system.b.push_back(from.b[row]);
    merged.system.R.push_back(number(from.R));
    merged.system.mu.push_back(number(from.mu));
    merged.system.lo.push_back(number(from.lo));
    merged.system.hi.push_back(number(from.hi));
  }
  return merged;
}

}  // namespace stiction::scenes
