#pragma once

#include <cfenv>

#if defined(__SSE2__)
#include <xmmintrin.h>
#elif defined(__aarch64__)
#include <cstdint>
#endif

namespace stiction {

/// The floating-point environment the algorithms assume: round to nearest, subnormals kept. A process may have lost it
/// without knowing (loading a library built with relaxed arithmetic sets flush-to-zero). Every thread of a solve and
/// every public function that computes hence sets it and restores the former one
/// (tests/determinism/test_fp_entries.cpp). With SSE the algorithms never use the x87 unit, whose whole environment
/// takes longer to save and load than a small solve's sweeps. Its rounding is kept in step, so that std::fegetround()
/// is right. On AArch64 both modes are bits of FPCR, and std::fesetround() leaves flush-to-zero as it is.
class ScopedFpEnv {
 public:
#if defined(__SSE2__)
  ScopedFpEnv() : rounding_(std::fegetround()), saved_(_mm_getcsr()) {
    constexpr unsigned kFlushToZero = 0x8000U;
    constexpr unsigned kDenormalsAreZero = 0x0040U;
    if (rounding_ != FE_TONEAREST) std::fesetround(FE_TONEAREST);
    _mm_setcsr(saved_ & ~(kFlushToZero | kDenormalsAreZero | _MM_ROUND_MASK));
    keep_order();
  }
  ~ScopedFpEnv() {
    keep_order();
    if (rounding_ != FE_TONEAREST) std::fesetround(rounding_);
    _mm_setcsr(saved_);
  }
#elif defined(__aarch64__)
  ScopedFpEnv() {
    asm volatile("mrs %0, fpcr" : "=r"(control_));
    asm volatile("mrs %0, fpsr" : "=r"(status_));
    set_control(control_ & ~kModes);
    keep_order();
  }
  ~ScopedFpEnv() {
    keep_order();
    set_control(control_);
    asm volatile("msr fpsr, %0" : : "r"(status_));
  }
#else
  ScopedFpEnv() {
    std::fegetenv(&saved_);
    std::fesetround(FE_TONEAREST);
    keep_order();
  }
  ~ScopedFpEnv() {
    keep_order();
    std::fesetenv(&saved_);
  }
#endif
  ScopedFpEnv(const ScopedFpEnv&) = delete;
  ScopedFpEnv& operator=(const ScopedFpEnv&) = delete;

 private:
  /// To a compiler arithmetic does not depend on modes: it may compute with earlier reads before they are set, or
  /// store afterwards. Nothing is read or written across this. A number that is returned in a register is not held by
  /// it: functions with a guard return their numbers in memory.
  static void keep_order() { asm volatile("" ::: "memory"); }

#if defined(__SSE2__)
  int rounding_;    ///< of the x87 unit
  unsigned saved_;  ///< control and status of SSE
#elif defined(__aarch64__)
  /// Bits of FPCR: flushed inputs, alternate handling and NEP of FEAT_AFP; flushed halves; the rounding mode;
  /// flush-to-zero; default NaN (Arm Architecture Reference Manual, FPCR).
  static constexpr std::uint64_t kModes = 0x7U | 1U << 19 | 3U << 22 | 1U << 24 | 1U << 25;
  static void set_control(std::uint64_t value) { asm volatile("msr fpcr, %0" : : "r"(value)); }

  std::uint64_t control_;  ///< FPCR
  std::uint64_t status_;   ///< FPSR
#else
  std::fenv_t saved_{};
#endif
};

}  // namespace stiction
