#pragma once

#include "core/algorithm/system/cone_slots.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// Rows that cannot move (docs/math/immovable.md): all of A + diag R is zero there, so w = b whatever the reactions
/// are. The choice that such a row leaves is known while it is loaded, and no method is given it.
namespace stiction::inline STICTION_ISA {

/// Returns true if a row of A + diag R is zero. A row with R < 0 is not.
template <class Real>
STICTION_HD_OUTLINE bool is_flat_row(const EnvView<Real>& env, Index row) {
  const bool has_factor = env.factor != nullptr;
  const Real* const entry =
      has_factor ? env.factor + static_cast<Offset>(row) * env.dofs : env.A + env.row_offsets[row];
  const Index count = has_factor ? env.dofs : env.entries(row);
  bool flat = env.R[row] == Real(0);
  for (Index k = 0; flat && k < count; ++k) flat = entry[k] == Real(0);
  return flat;
}

/// Rows of a cone that are held, bit k for row k with the normal first. A contact whose normal row is flat carries
/// nothing: all of its rows are. Each row of a free cone counts for itself. Semidefinite cones have none.
template <class Real>
STICTION_HD_OUTLINE unsigned held_rows(const EnvView<Real>& env, Index cone) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  const Index size = env.cone_size(cone);
  if (kind == ConeKind::semidefinite) return 0;
  unsigned held = 0;
  if (kind == ConeKind::free) {
    for (Index k = 0; k < size; ++k)
      if (is_flat_row(env, first + k)) held |= 1U << k;
  } else if (is_flat_row(env, env.row_of(first, size, 0))) {
    held = (1U << size) - 1U;
  }
  return held;
}

/// The reaction of a box row whose motion is b: the bound that b pushes it to. If there is none, no reaction obeys the
/// law, and it is the one nearest to zero.
template <class Real>
STICTION_HD Real held_reaction(Real b, Real lo, Real hi) {
  const Real bound = b > Real(0) ? lo : hi;
  return b != Real(0) && finite_(bound) ? bound : canonical_zero(clamp_(Real(0), lo, hi));
}

/// Returns true if the law of a cone with held rows asks one of them to move: no reaction obeys it.
template <class Real>
STICTION_HD_OUTLINE bool is_asked_to_move(const EnvView<Real>& env, Index cone, unsigned held) {
  const ConeKind kind = env.kind[cone];
  const Index first = env.cone_row(cone);
  const Index size = env.cone_size(cone);
  if (kind == ConeKind::free) {
    bool asked = false;
    for (Index k = 0; k < size; ++k) asked = asked || ((held >> k & 1U) != 0 && env.b[first + k] != Real(0));
    return asked;
  }
  const Real b = env.b[env.row_of(first, size, 0)];
  if (kind == ConeKind::box)
    return (b > Real(0) && !finite_(lower_bound(env, first))) || (b < Real(0) && !finite_(upper_bound(env, first)));
  if (kind != ConeKind::friction || env.law == Law::coulomb) return b < Real(0);
  // The convex law asks a contact that slides to open.
  double slip = 0.0;
  for (Index k = 1; k < size; ++k) {
    const Index i = env.row_of(first, size, k);
    const double along = static_cast<double>(env.friction(i)) * static_cast<double>(env.b[i]);
    slip = fma_(along, along, slip);
  }
  return static_cast<double>(b) < sqrt_(slip);
}

/// Row `row` of the matrix becomes that of a row by itself, with a diagonal of 1. `couples`: it is one of friction that
/// has other entries. They become zero in row and column.
template <class Real, int kStride>
STICTION_HD void hold_row(const DenseSystem<Real, kStride>& s, const EnvView<Real>&, Index, Index row, bool couples) {
  for (Index j = 0; couples && j < s.n; ++j) s.A[row + s.n * j] = s.A[j + s.n * row] = 0;
  s.A[row + s.n * row] = 1;
}
/// Applies hold_row() to the blocks of the rows from `first` on.
template <class Real>
STICTION_HD void hold_block(const FileOrderSystem<Real>& s, Index first, Index size, Index row, bool couples) {
  const Index own = row - first;
  for (Index k = 0; couples && k < size; ++k) s.blocks[first * 6 + own * 6 + k] = s.blocks[first * 6 + k * 6 + own] = 0;
  s.blocks[first * 6 + own * 7] = 1;
  s.R[row] = 1;
}
template <class Real>
STICTION_HD void hold_row(const SparseSystem<Real>& s, const EnvView<Real>& env, Index cone, Index row, bool couples) {
  for (Index i = 0; couples && i < env.n; ++i) {
    const Index* const column = env.columns(i);
    for (Index t = 0; t < env.entries(i); ++t)
      if (i == row || column[t] == row) s.value.data[env.row_offsets[i] - env.row_offsets[0] + t] = 0;
  }
  hold_block(s, env.cone_row(cone), env.cone_size(cone), row, couples);
}
template <class Real>
STICTION_HD void hold_row(const FactorSystem<Real>& s, const EnvView<Real>& env, Index cone, Index row, bool couples) {
  for (Index k = 0; couples && k < s.dofs; ++k) s.Y.data[static_cast<Offset>(row) * s.dofs + k] = 0;
  hold_block(s, env.cone_row(cone), env.cone_size(cone), row, couples);
}

/// Puts a cone's held rows by themselves, once A is in the solver's coordinates and b, x, lo and hi are the batch's
/// own. A contact is one that opens, a box row is held at its reaction, an equality holds.
template <class Real, class System, class Scales>
STICTION_HD_OUTLINE void hold_cone(const EnvView<Real>& env, System& s, Index cone, ConeSlot slot, unsigned held,
                                   const Scales& scales) {
  const ConeKind kind = env.kind[cone];
  const Index size = env.cone_size(cone);
  for (Index k = 0; k < size; ++k) {
    if ((held >> k & 1U) == 0) continue;
    const Index row = slot.row + k;
    hold_row(s, env, cone, row, k > 0 && !is_flat_row(env, env.row_of(env.cone_row(cone), size, k)));
    const bool opens = k == 0 && (kind == ConeKind::unilateral || carries_friction(kind));
    if (kind == ConeKind::box)
      s.lo[slot.cone] = s.hi[slot.cone] = held_reaction(s.b[row], s.lo[slot.cone], s.hi[slot.cone]);
    s.x[row] = kind == ConeKind::box ? s.lo[slot.cone] : Real(0);
    s.b[row] = opens ? div_(Real(1), scales.b) : Real(0);
  }
}

}  // namespace stiction::inline STICTION_ISA
