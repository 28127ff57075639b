#pragma once

#include <functional>
#include <span>
#include <vector>

#include "distributed/solve/solve_over_ranks.hpp"

/// One scene over several ranks with few exchanges: consensus ADMM between subdomains (docs/math/consensus.md).
namespace stiction::distributed {

struct ConsensusOptions {
  int subdomains = 8;   ///< >= 1; the bits follow this number, not that of ranks
  Index sweeps = 16;    ///< of sequential impulses in each subdomain between two exchanges, >= 1; doubled where they
                        ///< change no impulse
  double penalty = 32;  ///< the first, in units of a body's mass, > 0; balanced from there [-]
  /// No rank waits for another one's round: each goes on with its letters (docs/math/consensus.md). The answer is one
  /// of the same problem, judged in the same way, but no longer the same bits each time. Convex law alone.
  bool asynchronous = false;
  /// Called on each rank after the sweeps of each of its rounds. For measurements.
  std::function<void()> after_sweeps = {};
};

/// Solves every environment of a host batch, which all ranks have. `part` gives the subdomain of each body, the same
/// on all ranks (body_count). A subdomain is swept as BodySolver sweeps an environment. `options.iterations` limits
/// sweeps, of which whole rounds of `sweeps` are made, and status counts them. Each rank solves some of the
/// subdomains; answers have the same bits for any number of ranks. Rank 0 gets the solution, as of solve_over_ranks().
/// Status is a BodySolver's verdict on the impulses that are returned.
///
/// With the convex law the iteration is that of a convex problem, solved inexactly in each subdomain. With Coulomb's
/// law or boxed friction a point where it rests is a solution, and that it comes to rest is not proven.
///
/// \throws as solve_over_ranks, also Error(unsupported) for more than one sub-step, and for asynchronous rounds under
/// another law than the convex one
template <class Real>
std::vector<RankReport> solve_by_consensus(Transport& transport, const BodyBatchView<Real>& batch,
                                           std::span<const int> part, const ConsensusOptions& consensus,
                                           const TimeStepping& stepping, const BodySolverOptions& options,
                                           const BodySolutionView<Real>& solution, const Real* warm_start = nullptr);

}  // namespace stiction::distributed
