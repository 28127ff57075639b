#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "distributed/transport/transport.hpp"
#include "stiction/bodies.hpp"

/// Sequential impulses of one scene over several ranks, with the bits of one process (docs/howto/ranks.md).
namespace stiction::distributed {

/// Work of one rank, all environments together.
struct RankReport {
  double seconds = 0;       ///< of the iteration, without planning and collecting [s]
  double waited = 0;        ///< of those, for other ranks [s]
  std::int64_t bodies = 0;  ///< owned, and ghosts
  std::int64_t ghosts = 0;
  std::int64_t contacts = 0;   ///< visited; those between two ranks by both
  std::int64_t exchanges = 0;  ///< of twists with neighbours
  std::int64_t gathers = 0;    ///< of one number of every rank: residual, largest step
  std::int64_t messages = 0;   ///< sent in exchanges
  std::int64_t bytes = 0;      ///< of those messages
  std::int64_t rounds = 0;     ///< of consensus
};

/// Solves every environment of a host batch, which all ranks have, over the ranks of a transport. `owner` gives the
/// rank that owns each body, the same on all ranks (body_count). Options, plan and bits are those of BodySolver on the
/// CPU. Rank 0 gets the solution and writes it, others write nothing and may pass null pointers. All ranks call this,
/// and all get each one's record, by rank.
///
/// \throws Error(invalid_argument) as BodySolver, for an owner that is no rank, and if ranks were given different
/// batches, options or owners. Error(unsupported) for a method other than impulses, or a limit of contacts. RankLost
template <class Real>
std::vector<RankReport> solve_over_ranks(Transport& transport, const BodyBatchView<Real>& batch,
                                         std::span<const int> owner, const TimeStepping& stepping,
                                         const BodySolverOptions& options, const BodySolutionView<Real>& solution,
                                         const Real* warm_start = nullptr);

}  // namespace stiction::distributed
