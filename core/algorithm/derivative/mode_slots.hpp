#pragma once

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

/// Slots of the cones of environments that are differentiated side by side. Host only.
namespace stiction::inline STICTION_ISA {

/// Cones of several environments in one order that has each environment's own order in it: runs of cones with as many
/// rows. Missing cones are gaps in the lane. The order of sums then follows from the environment alone.
class ModeSlots {
 public:
  static constexpr Index kMostRuns = 16;

  [[nodiscard]] Index runs() const { return runs_; }
  [[nodiscard]] Index size(Index run) const { return run_[run].size; }
  [[nodiscard]] Index count(Index run) const { return run_[run].count; }
  [[nodiscard]] Index rows() const {
    Index sum = 0;
    for (Index run = 0; run < runs_; ++run) sum += run_[run].size * run_[run].count;
    return sum;
  }

  /// Makes room for an environment whose cone i has size(i) rows. False, and nothing is changed, where that takes too
  /// many runs, or more rows than `most_rows`.
  template <class Size>
  [[nodiscard]] bool take(Index cones, const Size& size, Index most_rows) {
    ModeSlots wider = *this;
    Index at = 0;
    for (Index first = 0; first < cones;) {
      Index next = first + 1;
      while (next < cones && size(next) == size(first)) ++next;
      at = wider.find(at, size(first));
      if (at == kNone) return false;
      if (wider.run_[at].count < next - first) wider.run_[at].count = next - first;
      ++at;
      first = next;
    }
    if (wider.rows() > most_rows) return false;
    *this = wider;
    return true;
  }

  /// f(cone, first of its rows here) for the cones of an environment that was taken.
  template <class Size, class F>
  void for_each_cone(Index cones, const Size& size, const F& f) const {
    Index run = 0, row = 0;
    for (Index first = 0; first < cones;) {
      while (run_[run].size != size(first)) row += run_[run].size * run_[run].count, ++run;
      Index cone = first;
      for (; cone < cones && size(cone) == size(first); ++cone) f(cone, row + (cone - first) * size(first));
      row += run_[run].size * run_[run].count;
      ++run;
      first = cone;
    }
  }

 private:
  struct Run {
    Index size;
    Index count;
  };
  static constexpr Index kNone = -1;

  /// The first run of that size from `from` on, or a new one there.
  Index find(Index from, Index size) {
    for (Index run = from; run < runs_; ++run)
      if (run_[run].size == size) return run;
    if (runs_ == kMostRuns) return kNone;
    for (Index run = runs_; run > from; --run) run_[run] = run_[run - 1];
    run_[from] = {size, 0};
    ++runs_;
    return from;
  }

  Run run_[kMostRuns] = {};
  Index runs_ = 0;
};

}  // namespace stiction::inline STICTION_ISA
