#pragma once

#include "core/base/pack.hpp"

/// Environments, or rows, in the lanes of a vector. Differs from one instruction set to the next.
namespace stiction::inline STICTION_ISA {

// Without an instruction for fma every lane calls the library, and a pack would only add code: one environment, or one
// row, at a time. Tests ask for widths beyond the instruction set: the compiler then splits or halves vectors.
#if defined(STICTION_VECTOR_BYTES)
#elif defined(__AVX512F__) && defined(__AVX512DQ__)
#define STICTION_VECTOR_BYTES 64
#elif defined(__AVX2__) && defined(__FMA__)
#define STICTION_VECTOR_BYTES 32
#elif defined(__ARM_NEON)
#define STICTION_VECTOR_BYTES 16
#else
#define STICTION_VECTOR_BYTES 0
#endif
inline constexpr int kVectorBytes = STICTION_VECTOR_BYTES;

/// Defined if this build has kernels for packs alone: a CPU that runs it takes all others from a narrower one.
#if defined(STICTION_PACKS_ALONE)
inline constexpr bool kPacksAlone = true;
#else
inline constexpr bool kPacksAlone = false;
#endif

/// Defined if wider vectors have kernels of packs and run here; this source then has none. Differs within a build.
#if defined(STICTION_SINGLES_ALONE)
constexpr bool kSinglesAlone = true;
#else
constexpr bool kSinglesAlone = false;
#endif

/// Numbers that a vector of this instruction set holds.
template <class Real>
inline constexpr int kPackWidth = kVectorBytes == 0 ? 1 : kVectorBytes / static_cast<int>(sizeof(Real));

}  // namespace stiction::inline STICTION_ISA
