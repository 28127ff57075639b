#pragma once

#include "core/team/phases.hpp"
#include "core/team/reduce.hpp"

namespace stiction::inline STICTION_ISA {

/// Steps that Anderson's acceleration looks back on.
inline constexpr Index kAndersonMemory = 5;

/// Weights of the remembered steps.
struct AndersonWeights {
  double gamma[kAndersonMemory];
};

/// Index of the inner product of remembered steps i >= j, and, for i = kAndersonMemory, of f with step j.
STICTION_HD constexpr Index gram_place(Index i, Index j) {
  return i * (i + 1) / 2 + j;
}
inline constexpr Index kGramEntries = gram_place(kAndersonMemory, kAndersonMemory);
static_assert(kGramEntries <= kReduceLeaves);

/// gamma = argmin |f - sum gamma_j step_j|^2 + small |gamma|^2 from the inner products, by Cholesky's factor of the
/// normal equations. The small term is relative to the largest step, so a step that repeats another is harmless.
STICTION_HD AndersonWeights anderson_weights(const double* gram, Index count) {
  constexpr double kRegularisation = 1e-10;
  AndersonWeights weights{};
  double L[kAndersonMemory][kAndersonMemory];
  double largest = 0.0;
  for (Index i = 0; i < count; ++i) largest = max_(gram[gram_place(i, i)], largest);
  if (!(largest > 0.0)) return weights;
  for (Index j = 0; j < count; ++j)
    for (Index i = j; i < count; ++i) {
      double sum = gram[gram_place(i, j)] + (i == j ? kRegularisation * largest : 0.0);
      for (Index k = 0; k < j; ++k) sum = fma_(0.0 - L[i][k], L[j][k], sum);
      L[i][j] = i == j ? sqrt_(max_(sum, 0.5 * kRegularisation * largest)) : div_(sum, L[j][j]);
    }
  for (Index i = 0; i < count; ++i) {
    double sum = gram[gram_place(kAndersonMemory, i)];
    for (Index k = 0; k < i; ++k) sum = fma_(0.0 - L[i][k], weights.gamma[k], sum);
    weights.gamma[i] = div_(sum, L[i][i]);
  }
  for (Index i = count - 1; i >= 0; --i) {
    double sum = weights.gamma[i];
    for (Index k = i + 1; k < count; ++k) sum = fma_(0.0 - L[k][i], weights.gamma[k], sum);
    weights.gamma[i] = div_(sum, L[i][i]);
  }
  return weights;
}

/// The weights for a residual f and `count` remembered changes of it, change(j) being a vector of n. Each inner product
/// is summed by one lane from the left.
template <Team TeamT, class Change>
STICTION_HD_OUTLINE AndersonWeights anderson(TeamT& team, Index n, const double* f, Index count, Change&& change) {
  double own[kGramEntries];
  double* gram = own;
  const auto fill = [&](Index i, Index j) {
    const double* const left = i == kAndersonMemory ? f : change(i);
    const double* const right = change(j);
    double sum = 0.0;
    for (Index k = 0; k < n; ++k) sum = fma_(left[k], right[k], sum);
    gram[gram_place(i, j)] = sum;
  };
  if (team.size() > 1) gram = team.template leaves<double>();
  for_each(team, (kAndersonMemory + 1) * kAndersonMemory, [&](Index entry) {
    const Index i = entry / kAndersonMemory;
    const Index j = entry % kAndersonMemory;
    if (j < count && j <= i && (i < count || i == kAndersonMemory)) fill(i, j);
  });
  return team.broadcast([&] { return anderson_weights(gram, count); });
}

}  // namespace stiction::inline STICTION_ISA
