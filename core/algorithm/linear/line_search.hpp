#pragma once

#include "core/base/real.hpp"

namespace stiction::inline STICTION_ISA {

/// Trials of a line search; where contacts slide or open the slope bends.
inline constexpr int kLineTrials = 24;

/// Slope and curvature of a function at one place of a line.
struct LinePoint {
  double slope;
  double curvature;
};

/// The step at which a convex function is smallest on a line, by Newton's method inside a bracket. look(alpha) returns
/// its LinePoint, the same on every lane; `slope` is that at 0, below zero, of which the share `part` may be left.
/// `noise` is the rounding of a slope that is zero.
template <class Look>
STICTION_HD double search_line(Look&& look, double slope, double part, double noise) {
  double before = 0.0;
  double beyond = __builtin_huge_val();
  double alpha = 1.0;
  const double enough = max_(part * abs_(slope), noise);
  for (int trial = 0; trial < kLineTrials; ++trial) {
    const LinePoint there = look(alpha);
    if (!(abs_(there.slope) > enough)) break;
    if (there.slope < 0.0) {
      before = alpha;
    } else {
      beyond = alpha;
    }
    const double newton = alpha - div_(there.slope, there.curvature);
    const double inside = finite_(beyond) ? 0.5 * (before + beyond) : 4.0 * before;
    alpha = newton > before && newton < min_(beyond, 16.0 * max_(before, 1.0)) ? newton : inside;
  }
  return alpha;
}

}  // namespace stiction::inline STICTION_ISA
