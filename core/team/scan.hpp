#pragma once

#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Parts that a scan is cut into: enough for a wide block, few enough for one lane to add up. Integers add up alike in
/// any order, so this reaches speed only.
inline constexpr Index kScanParts = 256;

/// Returns the start of a part of n things, parts 0 .. parts; the last one is n.
STICTION_HD Index part_begin(Index n, Index part, Index parts) {
  return static_cast<Index>(static_cast<Offset>(n) * part / parts);
}

/// values[i] becomes the sum of all values before it. Returns the sum of all n, on every lane; `parts` has room for
/// kScanParts.
template <Team TeamT, class Integer>
STICTION_HD_OUTLINE Integer exclusive_scan(TeamT& team, Integer* values, Index n, Integer* parts) {
  for_each(team, kScanParts, [&](Index part) {
    const Index end = part_begin(n, part + 1, kScanParts);
    Integer sum = 0;
    for (Index i = part_begin(n, part, kScanParts); i < end; ++i) sum += values[i];
    parts[part] = sum;
  });
  const Integer total = team.broadcast([&] {
    Integer sum = 0;
    for (Index part = 0; part < kScanParts; ++part) {
      const Integer value = parts[part];
      parts[part] = sum;
      sum += value;
    }
    return sum;
  });
  for_each(team, kScanParts, [&](Index part) {
    const Index end = part_begin(n, part + 1, kScanParts);
    Integer sum = parts[part];
    for (Index i = part_begin(n, part, kScanParts); i < end; ++i) {
      const Integer value = values[i];
      values[i] = sum;
      sum += value;
    }
  });
  return total;
}

}  // namespace stiction::inline STICTION_ISA
