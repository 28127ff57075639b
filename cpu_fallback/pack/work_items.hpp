#pragma once

#include <functional>
#include <vector>

#include "core/plan/body_plan.hpp"
#include "core/plan/plan.hpp"
#include "cpu_fallback/tables/body_kernels.hpp"

namespace stiction::cpu {

/// A piece of work for one thread. A pack has slots for the parts of environments: cones (ConeCounts), or contacts and
/// bodies (PackShape).
template <class Shape>
struct WorkItem {
  std::vector<Offset> envs;
  Shape shape;          ///< layout of the pack
  bool packed = false;  ///< through the lanes of a pack, else one by one
};

/// Data that items depend on. Only speed depends on them.
template <class Shape>
struct WorkItemRules {
  int threads = 1;
  int pack_width = 1;  ///< 1: no packs
  /// Bytes that a pack of that shape goes through again and again.
  std::function<Offset(const Shape&)> pack_bytes;
};

/// Deals the plan's environments with `takes` out to threads: runs of similar dense environments
/// for packs, the rest one by one.
std::vector<WorkItem<ConeCounts>> make_work_items(const PlanData& plan, const std::function<bool(Offset)>& takes,
                                                  const WorkItemRules<ConeCounts>& rules);

/// Which environments of bodies are solved through lanes or one by one, and which by teams of threads.
struct BodyWorkItems {
  std::vector<WorkItem<PackShape>> items;
  std::vector<Offset> large;  ///< environments that get a team of threads each
};

/// Environments of like size share packs. Among equals those whose contacts are between the same bodies come together,
/// since their lanes then find twists side by side. The two arrays are those of the batch.
BodyWorkItems make_work_items(const BodyPlanData& plan, const Offset* env_body_offsets,
                              const Offset* env_contact_offsets, const WorkItemRules<PackShape>& rules);

}  // namespace stiction::cpu
