#pragma once

#include <string>
#include <vector>

#include "core/job/cone_blocks.hpp"
#include "core/plan/block_places.hpp"
#include "core/plan/cone_blocks.hpp"
#include "core/plan/plan.hpp"
#include "stiction/error.hpp"

namespace stiction {

/// The batch as machines read it under options.blocks, its cones not yet at their places. \throws where there can be
/// no blocks.
template <class Real>
ContactBatchView<Real> with_block_visits(ContactBatchView<Real> batch, const SolverOptions& options) {
  if (options.blocks == BlockMode::cones) return batch;
  const std::string blocks = std::string("blocks = ") + to_string(options.blocks);
  if (batch.space != MemorySpace::host)
    throw Error(ErrorCode::unsupported, blocks +
                                            " and the batch is in device memory, but blocks are found on the host: "
                                            "copy the batch with Solver::to_host, or choose BlockMode::cones");
  if (batch.normal_last)
    throw Error(ErrorCode::unsupported, blocks +
                                            " and normal_last = true, but blocks are of rows with the normal "
                                            "first: put it first, or choose BlockMode::cones");
  batch.block_visits = kBlockVisits;
  return batch;
}

/// Refuses a plan with blocks for a solve without them, and the reverse.
inline void require_plan_of_blocks(const PlanData& plan, const SolverOptions& options) {
  const bool has_blocks = !plan.block_places.empty();
  if (plan.cone_count == 0 || has_blocks == (options.blocks != BlockMode::cones)) return;
  throw Error(ErrorCode::invalid_argument, std::string("plan was made ") + (has_blocks ? "with" : "without") +
                                               " blocks and the solver has blocks = " + to_string(options.blocks) +
                                               ": make the plan by a solver of the same blocks");
}

/// A sound batch and the places of cones in blocks, if there are to be any.
template <class Real>
class BatchInBlocks {
 public:
  /// `known`: places that a plan has kept, or null: they are found.
  BatchInBlocks(const ContactBatchView<Real>& batch, const SolverOptions& options, const std::vector<Index>* known,
                const ParallelFor& parallel_for)
      : view_(with_block_visits(batch, options)) {
    if (options.blocks == BlockMode::cones) return;
    if (known == nullptr)
      places_ = block_places(batch, block_groups(batch, options.blocks, parallel_for), parallel_for);
    view_.cone_group = (known == nullptr ? places_ : *known).data();
  }
  BatchInBlocks(const BatchInBlocks&) = delete;
  BatchInBlocks& operator=(const BatchInBlocks&) = delete;

  [[nodiscard]] const ContactBatchView<Real>& view() const { return view_; }
  [[nodiscard]] std::vector<Index>& places() { return places_; }

 private:
  ContactBatchView<Real> view_;
  std::vector<Index> places_;
};

}  // namespace stiction
