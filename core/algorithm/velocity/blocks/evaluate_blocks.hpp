#pragma once

#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/velocity/blocks/load_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// What is found of the reactions of one environment.
struct BlockResidual {
  FinalResidual found;
  double inner = 0.0;  ///< largest motion that the gradient that is left would bring to a row [w]
};

/// The judge of an environment in blocks, of reactions as the batch's precision has them. It finds
/// v+ = v_free + M^-1 J' lambda, the motion of all rows and the natural map.
struct BlockJudge {
  const BlockTerms& terms;
  const MassBlocks& mass;
  Law law;

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
      add_cone(c, largest);
    });
    return {{sqrt_(team.max(largest.square)), team.max(largest.rounding_floor)}, team.max(inner)};
  }

 private:
  /// Rows between bounds are boxes, whatever their kind: a free row has infinite ones.
  STICTION_HD void add_cone(Index c, LargestResidual<double>& largest) const {
    if (terms.cones().rows(c) == 1) {
      add<Law::convex>(ConeShape<ConeKind::box, 1>{}, c, largest);
      return;
    }
    with_shape(ConeKind::friction, terms.cones().rows(c), [&](auto shape) {
      if constexpr (decltype(shape)::kKind == ConeKind::friction) {
        if (law == Law::coulomb) {
          add<Law::coulomb>(shape, c, largest);
        } else {
          add<Law::convex>(shape, c, largest);
        }
      }
    });
  }
  template <Law kLaw, class Shape>
  STICTION_HD void add(Shape shape, Index c, LargestResidual<double>& largest) const {
    constexpr int kRows = Shape::kRows;
    const BlockWorkspace& n = terms.n;
    double x[kRows];
    double y[kRows];
    for (int k = 0; k < kRows; ++k) {
      const Index row = terms.cones().row[c] + k;
      x[k] = k == 0 ? n.answer[row] : unit_reaction(n.answer[row], n.mu[row]);
      y[k] = n.mu[row] * n.motion[row];
    }
    const double lo = kRows == 1 ? n.law[3 * c + 1] : 0.0, hi = kRows == 1 ? n.law[3 * c + 2] : 0.0;
    largest.template add<kLaw>(shape, x, y, n.weight[c], lo, hi);
  }
};

}  // namespace stiction::inline STICTION_ISA
