#pragma once

#include "core/algorithm/load/held_rows.hpp"
#include "core/algorithm/problem/cone_projection.hpp"
#include "core/algorithm/problem/first_guess.hpp"
#include "core/team/reduce.hpp"

namespace stiction::inline STICTION_ISA {

/// Flags that an environment may carry and still be solved.
inline constexpr std::uint32_t kHarmlessFlags = kFlagWarmStartRejected | kFlagContactsDropped | kFlagImmovable;

/// Beside the flags of an environment that is being loaded: some of its rows are held. No status has it.
inline constexpr std::uint32_t kHoldsRows = 1U << 31;

/// Result of one pass over an environment's numbers.
template <class Real>
struct Inspection {
  std::uint32_t flags;    ///< EnvFlag bits; any but kHarmlessFlags makes the input invalid
  Real largest_b;         ///< max|b|, and the lack of a box row without a reaction [w]
  Real largest_diagonal;  ///< max of diag(A) + R [w / lambda]
  bool holds_rows;        ///< held_rows() of some cone
};

/// Diagonal of A + diag R at one row (duplicates add up), and whether every number of the row's A is finite.
template <class Real>
struct RowScan {
  Real diagonal;
  bool finite;
};

/// Returns true if all of them are finite. There is no branch on the data, so that it vectorises. This reads every
/// entry of every environment, and on small systems that costs as much as sweeps do.
template <class Real>
STICTION_HD bool all_finite(const Real* a, Offset count) {
  unsigned broken = 0;
  for (Offset k = 0; k < count; ++k) broken |= static_cast<unsigned>(!finite_(a[k]));
  return broken == 0;
}

/// `is_finite`: all of A is known to be.
template <class Real, class System>
STICTION_HD RowScan<Real> scan_row(const EnvView<Real>& env, const System&, Index row, bool is_finite) {
  const Offset begin = env.row_offsets[row];
  const Index count = env.entries(row);
  const Real* a = env.A + begin;
  const bool finite = is_finite || all_finite(a, count);
  Real diagonal = env.R[row];
  if (row < count && is_run(env, row)) {
    diagonal = diagonal + a[row];
  } else {
    const Index* column = env.columns(row);
    for (Index k = 0; k < count; ++k)
      if (column[k] == row) diagonal = diagonal + a[k];
  }
  return {diagonal, finite};
}

/// Scan of a row of Y.
template <class Real>
STICTION_HD RowScan<Real> scan_row(const EnvView<Real>& env, const FactorSystem<Real>&, Index row, bool) {
  const Real* y = env.factor + static_cast<Offset>(row) * env.dofs;
  bool finite = true;
  Real diagonal = env.R[row];
  for (Index k = 0; k < env.dofs; ++k) {
    finite = finite && finite_(y[k]);
    diagonal = fma_(y[k], y[k], diagonal);
  }
  return {diagonal, finite};
}

/// Flags of a cone that has a zero on the diagonal, of its normal row or a single one.
template <class Real>
STICTION_HD_OUTLINE std::uint32_t look_at_flat(const EnvView<Real>& env, Index cone) {
  const unsigned held = held_rows(env, cone);
  if (held == 0) return env.kind[cone] == ConeKind::free ? 0U : kFlagBadDiagonal;
  return kHoldsRows | (is_asked_to_move(env, cone, held) ? kFlagImmovable : 0U);
}

/// Distance of a box row without a reaction from its bounds [w].
template <class Real>
STICTION_HD Real lack_of(Real lo, Real hi, Real diagonal) {
  const Real lack = project_half_line(max_(lo, Real(0) - hi)) * diagonal;
  return select(and_(diagonal > Real(0), finite_(lack)), lack, Real(0));
}

/// look_at_flat() of all cones, if no more is known than that some diagonal is zero.
template <class Real, class System>
STICTION_HD_OUTLINE std::uint32_t look_at_flat_rows(const EnvView<Real>& env, const System& s) {
  std::uint32_t flags = 0;
  for (Index cone = 0; cone < env.cone_count; ++cone) {
    const Index size = env.cone_size(cone);
    bool is_flat = false;
    for (Index k = 0; k < (env.kind[cone] == ConeKind::free ? size : 1); ++k)
      is_flat = is_flat || scan_row(env, s, env.row_of(env.cone_row(cone), size, k), true).diagonal == Real(0);
    if (is_flat) flags |= look_at_flat(env, cone);
  }
  return flags;
}

/// Finiteness and signs, before anything is projected: a projection would turn NaN into zero. Leaves the sum of each
/// cone's diagonal in the system's residual_weight.
template <Team TeamT, class Real, class System>
STICTION_HD Inspection<Real> inspect(TeamT& team, const EnvView<Real>& env, System& s) {
  std::uint32_t flags = env.flags;
  Real largest_b(0);
  Real largest_diagonal(0);
  unsigned broken = 0;
  unsigned negative = 0;
  for (Index i = team.rank(); i < env.n; i += team.size()) {
    broken |= static_cast<unsigned>(!finite_(env.b[i])) | static_cast<unsigned>(!finite_(env.R[i]));
    negative |= static_cast<unsigned>(env.R[i] < Real(0));
    largest_b = max_(abs_(env.b[i]), largest_b);
  }
  if (broken != 0) flags |= kFlagNonFiniteInput;
  if (negative != 0) flags |= kFlagNegativeCompliance;
  const bool is_finite = env.is_full && all_finite(env.A + env.row_offsets[0], Offset{env.n} * env.n);
  for_each_slot(team, env, s, [&](Index cone, ConeSlot slot) {
    const ConeKind kind = env.kind[cone];
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    Real sum(0);
    for (Index k = 0; k < size; ++k) {
      const Index i = env.row_of(first, size, k);
      const RowScan<Real> row = scan_row(env, s, i, is_finite);
      bool finite = row.finite;
      if (carries_friction(kind) && k > 0) {
        finite = finite && finite_(env.friction(i));
        if (env.friction(i) < Real(0)) flags |= kFlagNegativeFriction;
      }
      if (kind == ConeKind::box) {
        finite = finite && env.lo[i] == env.lo[i] && env.hi[i] == env.hi[i];
        if (env.lo[i] > env.hi[i]) flags |= kFlagCrossedBounds;
      }
      if (!finite) flags |= kFlagNonFiniteInput;
      // A tangential row that couples to nothing is solvable (it slides). A normal or single row is so alone if it is
      // held.
      if (kind != ConeKind::free && row.diagonal < Real(0)) flags |= kFlagBadDiagonal;
      if (row.diagonal == Real(0) && (k == 0 || kind == ConeKind::free)) flags |= look_at_flat(env, cone);
      if (kind == ConeKind::box)
        largest_b = max_(lack_of(lower_bound(env, i), upper_bound(env, i), row.diagonal), largest_b);
      sum = sum + row.diagonal;
      largest_diagonal = max_(abs_(row.diagonal), largest_diagonal);
    }
    s.residual_weight[slot.cone] = sum;
  });
  if (env.warm_start != nullptr)
    for (Index i = team.rank(); i < env.n; i += team.size())
      if (!can_start_from(env.warm_start[i])) flags |= kFlagWarmStartRejected;
  flags = team.combine(flags);
  return {flags & ~kHoldsRows, team.max(largest_b), team.max(largest_diagonal), (flags & kHoldsRows) != 0};
}

}  // namespace stiction::inline STICTION_ISA
