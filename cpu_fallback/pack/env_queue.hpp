#pragma once

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

/// Runs of environments through one pack or through two that take turns. Compiled once per instruction set.
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

/// Runs shorter than so many times a pack's lanes go through one pack. Two are worth more than the idle lanes
/// they end with only if lanes come free and are filled again.
inline constexpr Offset kShortestForPairs = 2;

/// A pack (PackRun) until no environment is left in it or in its queue.
template <class Run>
void run_out(Run& pack) {
  while (pack.refill()) pack.advance();
}
/// Two packs that share a queue. They alternate as long as both have an environment: what one does hides what the other
/// waits for.
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

}  // namespace stiction::inline STICTION_ISA
