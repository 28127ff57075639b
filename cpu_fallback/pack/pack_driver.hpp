#pragma once

#include "core/base/pack.hpp"
#include "stiction/types.hpp"

/// Feeds environments through the lanes of a pack, whatever they are made of. Compiled once per instruction set.
namespace stiction::inline STICTION_ISA {

/// The environments of a run, in the order in which packs take them.
struct EnvQueue {
  const Offset* envs;
  Offset count;
  Offset next = 0;
  Offset prefetched = 0;  ///< until here memory has been asked for them
  [[nodiscard]] bool is_empty() const { return next == count; }
  Offset take() { return envs[next++]; }
};

/// A set of lanes of a pack.
class LaneSet {
 public:
  LaneSet() = default;
  explicit LaneSet(unsigned bits) : bits_(bits) {}
  void add(int lane) { bits_ |= 1U << lane; }
  void remove(int lane) { bits_ &= ~(1U << lane); }
  [[nodiscard]] bool has(int lane) const { return (bits_ >> lane & 1U) != 0; }
  [[nodiscard]] int count() const { return __builtin_popcount(bits_); }
  [[nodiscard]] bool is_empty() const { return bits_ == 0; }
  friend LaneSet operator&(LaneSet a, LaneSet b) { return LaneSet(a.bits_ & b.bits_); }
  /// f(lane), ascending.
  template <class F>
  void for_each(F&& f) const {
    for (unsigned rest = bits_; rest != 0; rest &= rest - 1) f(__builtin_ctz(rest));
  }

 private:
  unsigned bits_ = 0;
};

/// The mask of a set of lanes.
template <class Real, int W>
Mask<Pack<Real, W>> mask_of(LaneSet lanes) {
  Pack<Real, W> marked(0);
  lanes.for_each([&](int l) { marked.v[l] = Real(1); });
  return marked > Pack<Real, W>(0);
}

/// Lets environments enter and leave the lanes of a pack between chunks, so that the vector stays nearly full until the
/// queue ends. Each one starts at a chunk boundary with its own count of iterations. Its results hence do not depend
/// on its lane, its neighbours or the moment it entered. `Run` defines an environment in a lane:
///
///   kTogether                      free lanes that are waited for before any is loaded
///   LaneSet due()                  the busy lanes whose chunk has ended
///   void check_convergence(lanes)  releases those of them that are finished
///   LaneSet load_free_lanes()      takes from the queue; the lanes whose environments can be solved
///   void advance()                 the next chunk, or the rest of the first that ends
template <class Run, int kLanes>
class PackDriver {
 public:
  static constexpr int kWidth = kLanes;

  explicit PackDriver(EnvQueue& queue) : queue_(queue) {}

  /// Finishes environments that are due and loads others. Returns true if there is anything to advance.
  bool refill() {
    Run& run = static_cast<Run&>(*this);
    run.check_convergence(run.due());
    while (!queue_.is_empty() && busy_.count() <= kWidth - Run::kTogether) run.check_convergence(run.load_free_lanes());
    return !busy_.is_empty();
  }

 protected:
  EnvQueue& queue_;
  LaneSet busy_;
};

/// A pack until no environment is left in it or in its queue.
template <class Run>
void run_out(Run& pack) {
  while (pack.refill()) pack.advance();
}
/// Two packs that share a queue. They alternate as long as both have an environment: the work of one hides the latency
/// of the other.
template <class Run>
void run_out(Run& a, Run& b) {
  bool a_is_busy = a.refill();
  bool b_is_busy = b.refill();
  while (a_is_busy && b_is_busy) {
    Run::advance(a, b);
    a_is_busy = a.refill();
    b_is_busy = b.refill();
  }
  for (; a_is_busy; a_is_busy = a.refill()) a.advance();
  for (; b_is_busy; b_is_busy = b.refill()) b.advance();
}

/// Solves the queue in the pack that make(0) makes, or in that one and make(1) where two are `wanted`. Runs of fewer
/// environments than two packs have lanes go through one. Two are worth more than the idle lanes they end with only if
/// lanes come free and are filled again.
template <class Run, class Make>
void run_packs(const EnvQueue& queue, bool wanted, Make&& make) {
  Run one = make(0);
  if constexpr (Run::kTakesPairs) {
    if (wanted && queue.count >= 2 * Run::kWidth) {
      Run other = make(1);
      run_out(one, other);
      return;
    }
  }
  run_out(one);
}

}  // namespace stiction::inline STICTION_ISA
