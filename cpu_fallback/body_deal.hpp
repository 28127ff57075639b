#pragma once

#include <functional>
#include <vector>

#include "core/schedule/body_plan.hpp"
#include "cpu_fallback/bodies_job.hpp"

namespace stiction::cpu {

/// A piece of work for one thread.
struct BodyWork {
  std::vector<Offset> envs;
  BodyRoom room;        ///< layout of the pack
  bool packed = false;  ///< through the lanes of a pack, else one by one
};

/// Who solves what.
struct BodyDeal {
  std::vector<BodyWork> work;
  std::vector<Offset> large;  ///< environments that get a team of threads each
};

/// What dealing out depends on. Only speed does.
struct BodyDealRules {
  int threads = 1;
  int pack_width = 1;  ///< 1: no packs
  /// Bytes of a pack of that room.
  std::function<Offset(const BodyRoom&)> pack_bytes;
};

BodyDeal deal_out(const BodyPlanData& plan, const std::function<Index(Offset)>& bodies, const BodyDealRules& rules);

}  // namespace stiction::cpu
