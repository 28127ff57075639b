#pragma once

#include <atomic>
#include <thread>

#include "core/base/macros.hpp"

namespace stiction::inline STICTION_ISA {

/// kCount numbers that several threads read and change at once, for asynchronous sweeps alone (docs/math/si.md).
/// Changes by another thread are a matter of time, and so are the bits that come of them. Nothing that has promised its
/// bits uses this. The number behind them is a lock for those that change them, open at zero; reading does not
/// wait.
template <class Real, int kCount>
class SharedNumbers {
 public:
  explicit SharedNumbers(Real* numbers) : numbers_(numbers) {}

  /// The number that some thread left at place k last.
  [[nodiscard]] Real seen(int k) const { return at(k).load(std::memory_order_relaxed); }

  /// Replaces the number of each place k by f(k, number). No other thread changes them meanwhile.
  template <class F>
  void change(F&& f) const {
    constexpr int kSpins = 1000;
    for (int spins = 0; at(kCount).exchange(Real(1), std::memory_order_acquire) != Real(0); ++spins)
      if (spins >= kSpins) std::this_thread::yield();
    for (int k = 0; k < kCount; ++k) at(k).store(f(k, seen(k)), std::memory_order_relaxed);
    open();
  }
  /// Opens the lock, which has to be done before the first change.
  void open() const { at(kCount).store(Real(0), std::memory_order_release); }

 private:
  [[nodiscard]] std::atomic_ref<Real> at(int k) const { return std::atomic_ref<Real>(numbers_[k]); }

  Real* numbers_;
};

}  // namespace stiction::inline STICTION_ISA
