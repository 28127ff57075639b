#pragma once

#include "core/algorithm/linear/block/block_product.hpp"
#include "core/job/multigrid_view.hpp"

/// Which coarse body each body moves with. Aggregates come from the graph of all contacts. An open contact is an edge
/// of the graph, and H has nothing there. Bodies that H does not couple should not be made to move as one.
namespace stiction::inline STICTION_ISA {

/// Two bodies are held together if |H_ij|^2 > kHeldPart |H_ii| |H_jj|, in norms of Frobenius. (Vanek, Mandel and
/// Brezina 1996, section 4, whose 0.08 has the square 2^-7.3.) It only has to distinguish a contact from none.
inline constexpr double kHeldPart = 0x1p-15;

/// Rounds in which bodies join: the root's neighbours, their neighbours, and those beyond them.
inline constexpr Index kJoinRounds = 3;

/// The coarse body of each body of a level, as a whole number; -1 for one that is not coupled.
struct Attachment {
  BlockMatrix H;
  BlockPattern prolongation;
  const Index* aggregate;
  const Index* root;
  double* label;   ///< the result                     (rows)
  double* next;    ///< scratch                        (rows)
  double* weight;  ///< scratch, |H_ii|^2              (rows)

  [[nodiscard]] static STICTION_HD double squares(const double* K) {
    double sum = 0.0;
    for (Index i = 0; i < kBlockEntries; ++i) sum = fma_(K[i], K[i], sum);
    return sum;
  }

  /// The body joins the aggregate that the graph gave it if a member of it holds the body. Else it joins that of the
  /// body that holds it most firmly.
  [[nodiscard]] STICTION_HD double choose(Index body) const {
    double best = -1.0;
    double firmest = 0.0;
    for (Index k = H.pattern.offsets[body]; k < H.pattern.offsets[body + 1]; ++k) {
      const Index other = H.pattern.columns[k];
      if (other == body || label[other] < 0.0) continue;
      const double firmness = squares(H.block(k));
      const bool is_held = firmness * firmness > (kHeldPart * kHeldPart) * (weight[body] * weight[other]);
      const auto joined = static_cast<Index>(label[other]);
      if (!is_held || find_block(prolongation, body, joined) < 0) continue;
      if (joined == aggregate[body]) return label[other];
      if (firmness > firmest) {
        best = label[other];
        firmest = firmness;
      }
    }
    return best;
  }

  /// Roots begin, and the others join round by round. A body that is left stays with the aggregate of the graph. To
  /// leave such bodies to the smoother was measured to be worse on walls, better on towers.
  template <Team TeamT>
  STICTION_HD_OUTLINE void run(TeamT& team) const {
    for_each(team, H.pattern.rows, [&](Index body) {
      const Index own = aggregate[body];
      label[body] = own >= 0 && root[own] == body ? static_cast<double>(own) : -1.0;
      const Index diagonal = find_block(H.pattern, body, body);
      weight[body] = diagonal < 0 ? 0.0 : squares(H.block(diagonal));
    });
    for (Index round = 0; round < kJoinRounds; ++round) {
      for_each(team, H.pattern.rows, [&](Index body) { next[body] = label[body] < 0.0 ? choose(body) : label[body]; });
      for_each(team, H.pattern.rows, [&](Index body) { label[body] = next[body]; });
    }
    for_each(team, H.pattern.rows,
             [&](Index body) { label[body] = label[body] < 0.0 ? static_cast<double>(aggregate[body]) : label[body]; });
  }
};

}  // namespace stiction::inline STICTION_ISA
