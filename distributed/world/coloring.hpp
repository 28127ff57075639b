#pragma once

#include <cstdint>
#include <span>

#include "core/plan/colored_body_plan.hpp"
#include "distributed/transport/transport.hpp"
#include "distributed/world/piece_bodies.hpp"

namespace stiction::distributed {

/// Gives the vertices of this rank's piece the colours that make_body_plan() gives them in the whole, and returns how
/// many the whole has. `bodies` are the piece's. `vertices` are all that push a body of this rank's, in the whole's
/// order. All ranks call it. \throws RankLost
///
/// The colouring is greedy. A vertex hence waits for those before it in the order that share a body with it, and for
/// no others. A rank colours the vertices it can. At a vertex between two ranks each sends the colours in use at its
/// own body, once all before the vertex are known there. Then both find the smallest free one. `waves` counts the
/// exchanges that took. (Jones and Plassmann, A parallel graph coloring heuristic, SIAM J. Sci. Comput. 14(3), 1993.)
Index color_over_ranks(Transport& transport, const PieceBodies& bodies, std::span<const PushedBodies> vertices,
                       std::span<Index> colors, std::int64_t& waves);

}  // namespace stiction::distributed
