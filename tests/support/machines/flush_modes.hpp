#pragma once

#include <array>

#if defined(__SSE2__)
#include <xmmintrin.h>
#elif defined(__aarch64__)
#include <cstdint>
#endif

/// Modes of this processor for subnormals that IEEE-754 does not have: bits of MXCSR (SSE) or of FPCR (AArch64).
namespace stiction::test {

#if defined(__SSE2__)
/// Flush-to-zero, denormals-are-zero, both.
inline constexpr std::array<unsigned, 3> kFlushModes = {0x8000U, 0x0040U, 0x8040U};
inline constexpr unsigned kFlushBits = 0x8040U;

inline unsigned fp_control() {
  return _mm_getcsr();
}
inline void set_fp_control(unsigned value) {
  _mm_setcsr(value);
}
#elif defined(__aarch64__)
/// Flush-to-zero, of inputs and of results.
inline constexpr std::array<unsigned, 1> kFlushModes = {1U << 24};
inline constexpr unsigned kFlushBits = 1U << 24;

inline unsigned fp_control() {
  std::uint64_t value = 0;
  asm volatile("mrs %0, fpcr" : "=r"(value));
  return static_cast<unsigned>(value);
}
inline void set_fp_control(unsigned value) {
  asm volatile("msr fpcr, %0" : : "r"(static_cast<std::uint64_t>(value)) : "memory");
}
#else
inline constexpr std::array<unsigned, 0> kFlushModes = {};
inline constexpr unsigned kFlushBits = 0;

inline unsigned fp_control() {
  return 0;
}
inline void set_fp_control(unsigned) {}
#endif

}  // namespace stiction::test
