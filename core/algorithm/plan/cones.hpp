#pragma once

#include "core/algorithm/plan/structure.hpp"
#include "core/job/cone_counts.hpp"
#include "core/team/scan.hpp"

namespace stiction::inline STICTION_ISA {

/// Kinds and sizes of cones in canonical order: free, unilateral, box, friction of 2, 3, ... rows.
inline constexpr Index kConeBins = kConeShapes;
/// And two more bins, for how many of them have boxed friction, and how many are semidefinite matrices.
inline constexpr Index kCountedBins = kConeBins + 2;

STICTION_HD void count_bins(const StructureView& s, Index begin, Index end, Index* bins) {
  for (Index bin = 0; bin < kConeBins; ++bin) bins[bin] = 0;
  // Not in their bins, of which a device reads and writes each anew whenever any of them may have changed.
  Index boxed = 0, matrices = 0;
  for (Index cone = begin; cone < end; ++cone) {
    const ConeKind kind = s.kind[cone];
    ++bins[shape_of(kind, s.cone_size(cone))];
    boxed += kind == ConeKind::box_friction ? 1 : 0;
    matrices += kind == ConeKind::semidefinite ? 1 : 0;
  }
  bins[kConeBins] = boxed;
  bins[kConeBins + 1] = matrices;
}

STICTION_HD ConeCounts counts_of(const Index* bins) {
  ConeCounts counts;
  counts.free = bins[0];
  counts.unilateral = bins[1];
  counts.box = bins[2];
  for (Index rows = 2; rows <= kMaxConeRows; ++rows) counts.friction[rows] = bins[1 + rows];
  counts.box_friction = bins[kConeBins];
  counts.semidefinite = bins[kConeBins + 1];
  return counts;
}

/// Counts the cones of each kind.
STICTION_HD ConeCounts count_cones(const StructureView& s) {
  Index bins[kCountedBins];
  count_bins(s, 0, s.cones, bins);
  return counts_of(bins);
}

/// Counts the cones of each kind, on every lane; `parts` has room for kScanParts.
template <Team TeamT>
STICTION_HD ConeCounts count_cones(TeamT& team, const StructureView& s, Index* parts) {
  constexpr Index kParts = kScanParts / kCountedBins;
  for_each(team, kParts, [&](Index part) {
    count_bins(s, part_begin(s.cones, part, kParts), part_begin(s.cones, part + 1, kParts),
               parts + part * kCountedBins);
  });
  return team.broadcast([&] {
    for (Index i = kCountedBins; i < kParts * kCountedBins; ++i) parts[i % kCountedBins] += parts[i];
    return counts_of(parts);
  });
}

/// Counts a dense environment's cones and puts them into canonical order, stably, or to their places among blocks. One
/// lane's work: most such environments have a lane to themselves, and none has many cones.
template <Team TeamT>
STICTION_HD void plan_dense(TeamT& team, const StructureView& s, ConeCounts* counts, Index* cone_order) {
  single(team, [&] {
    Index next[kCountedBins];
    count_bins(s, 0, s.cones, next);
    *counts = counts_of(next);
    if (s.has_blocks) {
      for (Index cone = 0; cone < s.cones; ++cone) cone_order[place_of(s.group[cone])] = cone;
      return;
    }
    Index position = 0;
    for (Index bin = 0; bin < kConeBins; ++bin) {
      const Index count = next[bin];
      next[bin] = position;
      position += count;
    }
    for (Index cone = 0; cone < s.cones; ++cone) cone_order[next[shape_of(s.kind[cone], s.cone_size(cone))]++] = cone;
  });
}

}  // namespace stiction::inline STICTION_ISA
