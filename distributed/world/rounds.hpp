#pragma once

#include "core/plan/body_plan.hpp"
#include "distributed/solve/halo.hpp"
#include "distributed/world/piece_bodies.hpp"

namespace stiction::distributed {

/// When this rank sends twists of its bodies, and when it gets those of its ghosts. Only the owner of a body knows all
/// contacts of it, so it finds the rounds and sends them. All ranks call it, each with its piece and the piece's plan.
/// \throws RankLost
Rounds make_rounds(Transport& transport, const PieceBodies& bodies, const BodyPlanData& plan);

}  // namespace stiction::distributed
