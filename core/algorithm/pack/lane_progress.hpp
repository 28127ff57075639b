#pragma once

#include "core/algorithm/driver/check_convergence.hpp"
#include "core/algorithm/pack/pack_workspace.hpp"

/// Progress of the environments in the lanes of a pack.
namespace stiction::inline STICTION_ISA {

template <class T, int W>
PackMask<T, W> is_within(Pack<T, W> residual, Pack<T, W> tolerance) {
  return residual <= tolerance;
}

template <class T, int W>
PackMask<T, W> exceeds(Pack<T, W> a, Pack<T, W> b) {
  return a > b;
}

/// The largest Real not above a tolerance >= 0: a Real is within the one if and only if it is within the other. One
/// that is positive stays so, since a tolerance of 0 asks for every iteration. No error is the least of all numbers: it
/// is a root.
inline double rounded_down(double tolerance, double) {
  return tolerance;
}
inline float rounded_down(double tolerance, float) {
  const auto nearest = static_cast<float>(tolerance);
  constexpr float kLeast = 0x1p-149F;
  const float below = static_cast<double>(nearest) > tolerance ? __builtin_nextafterf(nearest, 0.0F) : nearest;
  return tolerance > 0.0 && below < kLeast ? kLeast : below;
}

/// Limits and searches of all lanes. Lanes without an environment have no iterations left: nothing is due there.
template <class Real, int W>
struct LaneSearch {
  using Lanes = Pack<Real, W>;
  Search<Lanes> search;
  Limits<Lanes, Counts<Lanes>> limits{Lanes(0), Counts<Lanes>(0), Counts<Lanes>(0)};

  void begin(int lane, const StopRule& rule) {
    const Search<Real> fresh;
    search.iterations.v[lane] = fresh.iterations;
    search.best_at.v[lane] = fresh.best_at;
    search.best.v[lane] = fresh.best;
    search.verified.v[lane] = fresh.verified;
    limits.tolerance.v[lane] = rounded_down(rule.tolerance, Real());
    limits.absolute.v[lane] = rounded_down(rule.absolute, Real());
    limits.max_iterations.v[lane] = rule.max_iterations;
    limits.stall_window.v[lane] = rule.stall_window;
  }
  void end(int lane) {
    search.iterations.v[lane] = 0;
    limits.max_iterations.v[lane] = 0;
  }
  [[nodiscard]] EnvProgress<Real> of(int lane, std::uint32_t flags) const {
    return {{search.iterations.v[lane], search.best_at.v[lane], search.best.v[lane], search.verified.v[lane]}, flags};
  }
};

/// One lane of a poll's results.
template <class T, int W>
EnvPoll poll_of_lane(const Poll<PackMask<T, W>>& poll, int lane) {
  return {is_set(poll.broken, lane), is_set(poll.stalled, lane), is_set(poll.stopped, lane), is_set(poll.ended, lane),
          is_set(poll.has_candidate, lane)};
}

}  // namespace stiction::inline STICTION_ISA
