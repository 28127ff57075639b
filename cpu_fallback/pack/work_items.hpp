#pragma once

#include <functional>
#include <vector>

#include "core/plan/plan.hpp"

namespace stiction::cpu {

/// A piece of work for one thread.
struct WorkItem {
  std::vector<Offset> envs;
  ConeCounts slots;     ///< layout of the pack
  bool packed = false;  ///< through the lanes of a pack, else one by one
};

/// Deals those of a plan's environments that `takes` says out to threads: runs of similar dense environments for packs,
/// the rest one by one. Only speed depends on it.
std::vector<WorkItem> make_work_items(const PlanData& plan, const std::function<bool(Offset)>& takes, int pack_width,
                                      std::size_t scalar_bytes, int threads);

}  // namespace stiction::cpu
