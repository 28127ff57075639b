#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stiction/bodies.hpp"

/// Subdomains of one environment, decided in integers; their number is the caller's and not that of ranks
/// (docs/math/consensus.md).
namespace stiction::distributed {

struct Subdomains {
  std::vector<std::vector<Index>> contacts;  ///< of each subdomain, ascending
  std::vector<std::vector<Index>> bodies;    ///< that those contacts name, ascending
  std::vector<std::vector<int>> holders;     ///< of each body that is pushed: subdomains that have it, ascending

  [[nodiscard]] int count() const { return static_cast<int>(contacts.size()); }
  /// Rank that a subdomain is solved by: as many neighbours each as there are, or one more.
  [[nodiscard]] int rank_of(int subdomain, int ranks) const {
    return static_cast<int>(static_cast<Offset>(subdomain) * ranks / count());
  }
};

/// Each contact is that of one subdomain: the one of body a if it is pushed, else of b. `part` is the subdomain of each
/// body of the batch's only environment.
template <class Real>
Subdomains make_subdomains(const BodyBatchView<Real>& batch, std::span<const int> part, int count);

}  // namespace stiction::distributed
