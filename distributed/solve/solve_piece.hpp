#pragma once

#include "core/job/body_job.hpp"
#include "distributed/solve/halo.hpp"
#include "distributed/solve/solve_over_ranks.hpp"

namespace stiction::distributed {

/// Runs sequential impulses on this rank's piece, a batch of one environment with its plan and its rounds, and adds
/// its times. `ghosts`: bodies of the piece that other ranks own.
template <class Real>
void solve_piece(Transport& transport, const BodyJob<Real>& piece, const Rounds& rounds, Offset ghosts,
                 RankReport& report);

}  // namespace stiction::distributed
