#pragma once

#include "core/team/phases.hpp"

/// A dense symmetric matrix of doubles, factored and solved by a team. Every entry is updated by one lane in an order
/// given by the columns alone. The bits hence do not depend on how many lanes there are.
namespace stiction::inline STICTION_ISA {

/// A square matrix, column by column.
struct DenseMatrix {
  double* data;
  Index n;
  STICTION_HD double& operator()(Index i, Index j) const { return data[i + static_cast<Offset>(n) * j]; }
};

/// Pivot in place of one that is not sound: the solution has no part along its direction.
inline constexpr double kReplacedPivot = 0x1p+512;

/// L D L' of a symmetric positive semidefinite K, of which the lower triangle is read (Golub and Van Loan 2013,
/// section 4.1.2, right-looking). Afterwards the diagonal holds D and both triangles hold L, so that both
/// substitutions read neighbours. A pivot that is not above `floor` belongs to a direction that K does not see. It is
/// replaced by a number so large that the solution has no part along it. Returns how many were, on every lane.
template <Team TeamT>
STICTION_HD_OUTLINE Index factor_ldl(TeamT& team, const DenseMatrix& K, double floor) {
  const Index n = K.n;
  Index replaced = 0;
  for (Index j = 0; j < n; ++j) {
    const double found = K(j, j);
    const bool is_sound = found > floor;
    const double pivot = is_sound ? found : kReplacedPivot;
    if (!is_sound) ++replaced;
    for_each(team, n - j - 1, [&](Index k) {
      const Index i = j + 1 + k;
      K(j, i) = div_(K(i, j), pivot);
      if (j > 0) K(i, j - 1) = K(j - 1, i);
    });
    const auto update = [&](Index i, Index k) { K(i, k) = fma_(0.0 - K(i, j), K(j, k), K(i, k)); };
    if (team.size() == 1) {
      K(j, j) = pivot;
      if (j > 0) K(j, j - 1) = K(j - 1, j);
      // Rows that nothing couples to change nothing. A lane on its own sees that for nothing; a team would have to
      // agree.
      bool couples = false;
      for (Index i = j + 1; i < n; ++i) couples = couples || K(i, j) != 0.0;
      for (Index k = j + 1; couples && k < n; ++k)
        for (Index i = k; i < n; ++i) update(i, k);
    } else {
      single(team, [&] {
        K(j, j) = pivot;
        if (j > 0) K(j, j - 1) = K(j - 1, j);
      });
      for_each(team, n - j - 1, [&](Index r) {
        const Index i = j + 1 + r;
        for (Index k = j + 1; k <= i; ++k) update(i, k);
      });
    }
  }
  return replaced;
}

/// v = K^-1 v by the factor.
template <Team TeamT>
STICTION_HD_OUTLINE void solve_ldl(TeamT& team, const DenseMatrix& K, double* v) {
  const Index n = K.n;
  for (Index j = 0; j + 1 < n; ++j) {
    const double known = v[j];
    for_each(team, n - j - 1, [&](Index k) {
      const Index i = j + 1 + k;
      v[i] = fma_(0.0 - K(i, j), known, v[i]);
    });
  }
  for_each(team, n, [&](Index i) { v[i] = div_(v[i], K(i, i)); });
  for (Index j = n - 1; j > 0; --j) {
    const double known = v[j];
    for_each(team, j, [&](Index i) { v[i] = fma_(0.0 - K(i, j), known, v[i]); });
  }
}

}  // namespace stiction::inline STICTION_ISA
