#pragma once

#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/velocity/blocks/load_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// Residual of the reactions of one environment.
struct BlockResidual {
  FinalResidual found;
  double inner = 0.0;  ///< largest motion that the gradient that is left would bring to a row [w]
};

/// The judge of an environment in blocks, of reactions as the batch's precision has them. It finds
/// v+ = v_free + M^-1 J' lambda, the motion of all rows and the errors of contacts.
struct BlockJudge {
  const BlockTerms& terms;
  const MassBlocks& mass;
  Law law;
  ErrorScale scale{};

  /// pushed = M^-1 J' reactions.
  template <Team TeamT>
  STICTION_HD_OUTLINE void push(TeamT& team, const double* reactions) const {
    const BlockWorkspace& n = terms.n;
    for_each(team, terms.lists.dofs.count, [&](Index block) {
      double sum[kBodyBlock] = {};
      terms.add_pushes(block, reactions, sum);
      for (Index i = 0; i < kBodyBlock; ++i) n.pushed[static_cast<Offset>(block) * kBodyBlock + i] = sum[i];
    });
    mass.solve(team, n.pushed);
  }

  /// Evaluates n.answer; n.motion and n.pushed are its.
  template <Team TeamT>
  STICTION_HD_OUTLINE BlockResidual evaluate(TeamT& team) const {
    const BlockWorkspace& n = terms.n;
    push(team, n.answer);
    LargestResidual<double> largest;
    double inner = 0.0;
    for_each(team, terms.cones().cones, [&](Index c) {
      double images[kMaxConeRows] = {};
      terms.times_cone(c, n.pushed, images);
      for (Index k = 0, row = terms.cones().row[c]; row < terms.cones().row[c + 1]; ++k, ++row) {
        inner = max_(abs_(((images[k] + n.b[row]) + n.shift[row]) - n.z[row]), inner);
        n.motion[row] = fma_(n.R[row], n.answer[row], images[k] + n.b[row]);
      }
      add_block_cone(terms, c, law, n.answer, n.motion, n.share[c], scale.unit, largest);
    });
    return {final_residual_of(team, largest, scale), team.max(inner)};
  }
};

}  // namespace stiction::inline STICTION_ISA
