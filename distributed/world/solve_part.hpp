#pragma once

#include "distributed/solve/solve_over_ranks.hpp"
#include "distributed/world/piece_bodies.hpp"

namespace stiction::distributed {

/// Solves an environment that no rank has as a whole, by sequential impulses with the bits of one process. `part` is a
/// host batch of one environment: contacts that push a body of this rank's, in the whole's order, and their bodies.
/// `bodies` names them. Each rank writes the impulses of its part (3 * part.contact_count) and adds its record. All
/// ranks call it, with the same options, and get one status.
///
/// \throws Error as solve_over_ranks for options. RankLost
template <class Real>
EnvStatus solve_part(Transport& transport, const BodyBatchView<Real>& part, const PieceBodies& bodies,
                     const TimeStepping& stepping, const BodySolverOptions& options, Real* impulse, RankReport& report);

}  // namespace stiction::distributed
