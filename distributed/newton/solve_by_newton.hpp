#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "distributed/newton/domains.hpp"
#include "distributed/solve/solve_over_ranks.hpp"

/// One scene over several ranks to high accuracy: Newton's method on the velocities of bodies, its linear systems by
/// gradients with two-level overlapping Schwarz (docs/math/domain_newton.md).
namespace stiction::distributed {

/// Counts of all environments together; on rank 0.
struct NewtonCounts {
  std::int64_t steps = 0;         ///< of Newton
  std::int64_t sweeps = 0;        ///< of sequential impulses, before them and where they are of no use
  std::int64_t linear_steps = 0;  ///< of conjugate and stabilized gradients
};

/// Solves every environment of a host batch, which all ranks have. `part` gives the subdomain of each body
/// (body_count), and `home` the rank of each subdomain (domains.count), the same on all ranks. Bits follow `part` and
/// neither `home` nor the number of ranks. `options.iterations` limits Newton steps, and status counts them.
/// `options.space.ordering` is that of the factors. Rank 0 gets the solution, as of solve_over_ranks(). Status is a
/// BodySolver's verdict on the impulses that are returned.
///
/// \throws as solve_over_ranks, and Error(unsupported) for a method other than newton, for more than one sub-step and
/// for boxed friction
template <class Real>
std::vector<RankReport> solve_by_newton(Transport& transport, const BodyBatchView<Real>& batch,
                                        std::span<const int> part, std::span<const int> home,
                                        const DomainOptions& domains, const TimeStepping& stepping,
                                        const BodySolverOptions& options, const BodySolutionView<Real>& solution,
                                        const Real* warm_start = nullptr, NewtonCounts* counts = nullptr);

/// The rank of each subdomain: as many neighbours each as there are, or one more.
std::vector<int> neighbouring_homes(int domains, int ranks);

}  // namespace stiction::distributed
