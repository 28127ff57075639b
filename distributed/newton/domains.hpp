#pragma once

#include <span>
#include <vector>

#include "core/job/block_pattern.hpp"
#include "distributed/solve/partition.hpp"

/// Subdomains of one environment for Newton's method over ranks, and the groups of bodies of its coarse space, in
/// integers. They follow from the scene and the number of subdomains; ranks reach nothing here
/// (docs/math/domain_newton.md).
namespace stiction::distributed {

/// Bodies of an aggregate, about as many.
inline constexpr Index kAggregateBodies = 16;

struct DomainOptions {
  int count = 8;          ///< subdomains, >= 1
  bool overlap = true;    ///< a subdomain's system has the neighbours of its bodies as well
  bool is_coarse = true;  ///< there is a coarse space
  Index sweeps = 48;      ///< of sequential impulses before the first step, >= 1
};

struct Domains {
  std::vector<std::vector<Index>> bodies;    ///< of each subdomain, ascending
  std::vector<std::vector<Index>> extended;  ///< those and, with overlap, their neighbours, ascending
  std::vector<std::vector<Index>> contacts;  ///< positions that it sums and judges, ascending
  std::vector<std::vector<int>> holders;     ///< of each body: subdomains whose extended has it, ascending
  std::vector<int> part;                     ///< of each body
  std::vector<Index> aggregate;              ///< of each body, -1 for one that no other body touches
  std::vector<Index> root;                   ///< of each aggregate, its lowest body
  std::vector<std::vector<Index>> members;   ///< of each aggregate, ascending, all of one subdomain
  std::vector<Index> coarse;                 ///< the pattern of the coarse matrix (take_pattern)

  [[nodiscard]] int count() const { return static_cast<int>(bodies.size()); }
  [[nodiscard]] Index aggregates() const { return static_cast<Index>(root.size()); }
  /// Subdomain of an aggregate.
  [[nodiscard]] int home_of(Index which) const;
  [[nodiscard]] BlockPattern coarse_pattern() const;
};

/// The pattern has a block where two bodies touch. Sides are those of the plan, two for each of the `contacts`
/// positions. `part` is the subdomain of each body, `points` where it is.
Domains make_domains(const BlockPattern& pattern, const Index* sides, Index contacts, std::span<const int> part,
                     std::span<const Point> points, const DomainOptions& options);

}  // namespace stiction::distributed
