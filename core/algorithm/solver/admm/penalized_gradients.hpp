#pragma once

#include "core/algorithm/solver/admm/penalized_matrix.hpp"

/// Solves with K + rho by conjugate gradients, preconditioned by the cones' own blocks (docs/math/admm.md). Nothing
/// here is reached by an environment that has room for a matrix.
namespace stiction::inline STICTION_ISA {

/// Part of the residual of the v before that a solve leaves, in the norm that the preconditioner makes. If the
/// iteration converges, so does the error.
inline constexpr double kPenalizedAccuracy = 1e-1;
/// Steps for one solve at most.
inline constexpr Index kMostPenalizedSteps = 200;

/// K + rho as an operator.
template <class System>
struct PenalizedOperator {
  const System* s;
  const AdmmState* a;
  double rho;

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* v, double* out) const {
    for_each(team, a->n, [&](Index i) { a->scaled[i] = a->scale[i] * v[i]; });
    prepare_wide_product(team, *s, a->scaled);
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      for (Index i = row; i < row + decltype(shape)::kRows; ++i)
        out[i] = fma_(own_penalty(shape, rho), v[i], a->scale[i] * wide_row(*s, i, a->scaled));
    });
  }
};

template <Team TeamT, class System>
STICTION_HD_OUTLINE void prepare_penalized_gradients(TeamT& team, const System& s, const AdmmState& a, double rho) {
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    double K[kRows][kRows];
    read_cone_block(s, row, K);
    for (int i = 0; i < kRows; ++i) {
      for (int j = 0; j < kRows; ++j) K[i][j] = K[i][j] * (a.scale[row] * a.scale[row]);
      K[i][i] = K[i][i] + own_penalty(shape, rho);
    }
    factor_cone_block(K, cone_block(a.cone_factors, row));
  });
}

/// v = (K + rho)^-1 v from the answer before. Overwrites f.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_penalized_gradients(TeamT& team, const System& s, const AdmmState& a, double rho) {
  const PenalizedOperator<System> K{&s, &a, rho};
  K.apply(team, a.answer, a.f);
  for_each(team, a.n, [&](Index i) { a.v[i] = a.v[i] - a.f[i]; });
  conjugate_gradient(team, K, {a.n, a.v, a.f, a.memory, kPenalizedAccuracy, kMostPenalizedSteps},
                     ConeBlocks<System>{&s, a.cone_factors});
  for_each(team, a.n, [&](Index i) { a.v[i] = a.answer[i] = a.answer[i] + a.f[i]; });
}

}  // namespace stiction::inline STICTION_ISA
