#pragma once

/// \file
/// Version, numerics epoch, and the marks of functions that run on host and device.

/// Version of the library's interface (semantic versioning); changes with what old programs cannot take.
#define STICTION_VERSION_MAJOR 0
#define STICTION_VERSION_MINOR 1  ///< changes with what is added
#define STICTION_VERSION_PATCH 0  ///< changes with what is mended

/// Marks a function that runs on host and device. It is always inlined. The CPU machine compiles the algorithms once
/// per instruction set. An out-of-line copy that the linker merged across those builds could be one the running CPU
/// cannot execute. This is the one place that asks which compiler is reading.
///
/// STICTION_HD_OUTLINE is for templates that run once per chunk or less. They have a type of their instruction set
/// among their arguments, so that no two builds share a symbol. On the device they stay functions, because a copy in
/// every kernel would cost minutes of compile time and megabytes of code. STICTION_HD_SHARED is for those of them that
/// a machine compiles once for all solvers (core/algorithm/driver/shared_instances.hpp): functions everywhere.
/// STICTION_HD_PART is for what the CPU machine shares of a function that is one on the device.
#if defined(__CUDACC__)
#define STICTION_HD __host__ __device__ __forceinline__
#define STICTION_HD_OUTLINE __host__ __device__ __noinline__
#define STICTION_HD_SHARED __host__ __device__ __noinline__
#define STICTION_HD_PART STICTION_HD
#else
#define STICTION_HD inline __attribute__((always_inline))
#define STICTION_HD_OUTLINE inline
#define STICTION_HD_SHARED __attribute__((noinline))
#define STICTION_HD_PART STICTION_HD_SHARED
#endif

namespace stiction {

/// Version of the library, "major.minor.patch".
inline constexpr const char* kVersion = "0.1.0";

/// Numerics epoch: results are bit-reproducible within one epoch. It changes, with a sentence in the
/// changelog, whenever any golden hash does (docs/explanation/numerics.md).
inline constexpr int kNumericsEpoch = 3;

}  // namespace stiction
