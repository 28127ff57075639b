#pragma once

#include <functional>
#include <vector>

#include "core/plan/body_plan.hpp"
#include "cpu_fallback/kernels/body_kernels.hpp"

namespace stiction::cpu {

/// A piece of work for one thread.
struct BodyWorkItem {
  std::vector<Offset> envs;
  PackShape shape;      ///< layout of the pack
  bool packed = false;  ///< through the lanes of a pack, else one by one
};

/// Who solves what.
struct BodyWorkItems {
  std::vector<BodyWorkItem> work;
  std::vector<Offset> large;  ///< environments that get a team of threads each
};

/// What dealing out depends on; only speed depends on how it is done.
struct BodyWorkItemRules {
  int threads = 1;
  int pack_width = 1;  ///< 1: no packs
  /// Bytes of a pack of that room.
  std::function<Offset(const PackShape&)> pack_bytes;
};

/// Environments of like size share packs; among equals those whose contacts are between the same bodies come together,
/// since their lanes then find twists side by side. The two arrays are those of the batch.
BodyWorkItems make_body_work_items(const BodyPlanData& plan, const Offset* env_body_offsets,
                                   const Offset* env_contact_offsets, const BodyWorkItemRules& rules);

}  // namespace stiction::cpu
