#pragma once

#include <span>
#include <vector>

#include "core/job/newton_stream.hpp"
#include "distributed/newton/domains.hpp"
#include "distributed/solve/halo.hpp"

/// Reach of one rank, and messages to others. Numbers of bodies, positions and blocks are the environment's.
namespace stiction::distributed {

struct Reach {
  std::vector<int> domains;     ///< subdomains that are this rank's, ascending
  std::vector<Index> rows;      ///< bodies of those and their neighbours: rows of H, forces, residuals
  std::vector<Index> seen;      ///< those and their neighbours: twists
  std::vector<Index> contacts;  ///< positions that push one of the rows, and those of the subdomains

  std::vector<Index> slot_offsets;            ///< into `slots`, of each of `seen`         (seen + 1)
  std::vector<int> slots;                     ///< the subdomain that a seen body's part of a correction is from
  std::vector<std::vector<Index>> own_slots;  ///< of each of `domains`, by its extended bodies
  std::vector<Index> aggregates;              ///< of the subdomains, ascending

  /// 0: six numbers of each slot, then of each aggregate. 1: six times six of each block of the coarse matrix.
  Rounds rounds;

  [[nodiscard]] Index slot_count() const { return static_cast<Index>(slots.size()); }
};

/// `home`: the rank of each subdomain.
Reach make_reach(const NewtonStream& stream, const Domains& domains, std::span<const int> home, int rank, int ranks);

}  // namespace stiction::distributed
