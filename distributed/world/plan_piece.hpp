#pragma once

#include "core/plan/body_plan.hpp"
#include "distributed/solve/halo.hpp"
#include "distributed/world/piece_bodies.hpp"
#include "stiction/bodies.hpp"

namespace stiction::distributed {

/// Plan of a rank's piece of an environment that no rank has as a whole.
struct PiecePlan {
  BodyPlanData plan;
  Rounds rounds;
};

/// Plans a piece, a batch of one environment, with the colours of the whole. Contacts are in the whole's order, all
/// that push a body of this rank's. `waves`: see color_over_ranks(). All ranks call it. \throws RankLost
template <class Real>
PiecePlan plan_piece(Transport& transport, const BodyBatchView<Real>& batch, const PieceBodies& bodies,
                     std::int64_t& waves);

}  // namespace stiction::distributed
