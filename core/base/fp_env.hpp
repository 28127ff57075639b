#pragma once

#include <cfenv>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace stiction {

/// The floating-point environment the bodies assume: round to nearest, subnormals kept. A process may have lost it
/// without asking (loading a library built with relaxed arithmetic sets flush-to-zero), so every solving thread sets it
/// and puts back what it found.
class ScopedFpEnv {
 public:
  ScopedFpEnv() {
    std::fegetenv(&saved_);
    std::fesetround(FE_TONEAREST);
#if defined(__SSE2__)
    constexpr unsigned kFlushToZero = 0x8000U;
    constexpr unsigned kDenormalsAreZero = 0x0040U;
    _mm_setcsr(_mm_getcsr() & ~(kFlushToZero | kDenormalsAreZero));
#endif
  }
  ~ScopedFpEnv() {
    std::fesetenv(&saved_);
  }
  ScopedFpEnv(const ScopedFpEnv&) = delete;
  ScopedFpEnv& operator=(const ScopedFpEnv&) = delete;

 private:
  std::fenv_t saved_{};
};

}  // namespace stiction
