#pragma once

#include <optional>
#include <span>
#include <vector>

#include "distributed/newton/domain_team.hpp"
#include "distributed/newton/part_factor.hpp"
#include "distributed/solve/partition.hpp"

namespace stiction::distributed {

/// Two-level additive Schwarz (Dryja and Widlund 1994; Toselli and Widlund 2005, chapter 3). It adds up the
/// subdomains' solutions of a residual, each by itself, and that of rigid motions of aggregates. It is symmetric and
/// positive definite as H is (docs/math/domain_newton.md).
class Schwarz {
 public:
  Schwarz(Transport& transport, const BlockPattern& pattern, const Domains& domains, const Reach& reach,
          std::span<const Point> points, Ordering ordering);

  /// Prepares the reach's rows of H.
  void prepare(const BlockMatrix& H);

  /// As a preconditioner: z of all that are seen, from r of the reach's rows. One exchange.
  template <Team TeamT>
  void apply(TeamT&, const double* r, double* z) {
    correct(r, z);
  }

 private:
  void correct(const double* r, double* z);
  void assemble_coarse(const BlockMatrix& H, PartFactor& factor);
  [[nodiscard]] const double* point(Index body) const { return points_[static_cast<std::size_t>(body)].data(); }
  [[nodiscard]] const double* root_of(Index aggregate) const {
    return point(domains_.root[static_cast<std::size_t>(aggregate)]);
  }
  /// Six numbers of an aggregate, after those of all slots.
  [[nodiscard]] double* told_of(Index aggregate) {
    return told_.data() + kBodyBlock * static_cast<Offset>(reach_.slot_count() + aggregate);
  }

  const Domains& domains_;
  const Reach& reach_;
  std::span<const Point> points_;
  Halo halo_;
  std::vector<PartFactor> parts_;  ///< of the reach's subdomains
  BlockPattern coarse_pattern_;
  std::vector<double> coarse_blocks_;
  std::optional<PartFactor> coarse_;
  std::vector<double> told_, right_, left_, moved_;
};

}  // namespace stiction::distributed
