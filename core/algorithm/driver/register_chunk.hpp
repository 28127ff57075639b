#pragma once

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/system/register_system.hpp"

/// Whole chunks of small environments with the system in registers (register_system.hpp). The bits are those of the
/// dense system. Both run one text, and an entry of A is read from above the diagonal only where it equals the one
/// below.
namespace stiction::inline STICTION_ISA {

/// Cones that the windows have room for.
inline constexpr Index kSmallWindow = 4;
inline constexpr Index kLargeWindow = 6;

/// True if there are windows at all. Other methods multiply by A, and doubles would need twice the registers there are.
template <class Method, class Real>
inline constexpr bool kHasWindows =
    (Method::kKind == SolverKind::pgs || Method::kKind == SolverKind::npgs || Method::kKind == SolverKind::subspace) &&
    sizeof(Real) == sizeof(float);

/// The window that a loaded system fits into: room for so many cones, or 0 for none.
template <class Real, int kStride>
STICTION_HD_OUTLINE Index register_capacity(const DenseSystem<Real, kStride>& s) {
  using Shape = ConeShape<ConeKind::friction, 3>;
  if (s.cones == 0 || s.cones > kLargeWindow || s.counts.friction[Shape::kRows] != s.cones) return 0;
  if (has_box_friction(s)) return 0;
  unsigned differ = 0;
  for (Index j = 0; j < s.n; ++j)
    for (Index i = 0; i < j; ++i)
      differ |= static_cast<unsigned>(bits_of(s.A[i + s.n * j]) != bits_of(s.A[j + s.n * i]));
  if (differ != 0) return 0;
  return s.cones <= kSmallWindow ? kSmallWindow : kLargeWindow;
}

/// kChunk iterations of a system that fits into a window of kCones.
template <class Method, Law kLaw, Index kCones, class Real, int kStride>
STICTION_HD void iterate_in_registers(DenseSystem<Real, kStride>& s, const MethodParams<Real>& params) {
  SerialTeam team;
  RegisterSystem<Real, kCones, kStride> window(s);
  for (Index k = 0; k < kChunk; ++k) Method::template iterate<kLaw>(team, window, params);
  window.store(s);
}

/// The next chunk of an environment for which register_capacity() returned `window`. A chunk that is cut short is
/// recorded in its middle, which the dense system is for.
template <class Method, Law kLaw, class Real, int kStride>
STICTION_HD void advance_chunk(SerialTeam& team, DenseSystem<Real, kStride>& s, const MethodParams<Real>& params,
                               const StopRule& rule, EnvProgress<Real>& progress, Index window) {
  if (window == 0 || rule.max_iterations - progress.iterations < kChunk) {
    advance_chunk<Method, kLaw>(team, s, params, rule, progress);
    return;
  }
  if (window == kSmallWindow) {
    iterate_in_registers<Method, kLaw, kSmallWindow>(s, params);
  } else {
    iterate_in_registers<Method, kLaw, kLargeWindow>(s, params);
  }
  end_chunk<Method, kLaw>(team, s, static_cast<Real>(progress.iterations % kRefreshInterval), true);
  progress.iterations += kChunk;
}

}  // namespace stiction::inline STICTION_ISA
