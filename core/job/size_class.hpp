#pragma once

#include "core/job/cone_counts.hpp"

namespace stiction {

/// Environments that a device answers with one kernel launch, most expensive first. Which class an environment falls
/// into reaches speed only: every class runs the same algorithms.
enum class SizeClass : std::uint8_t {
  sparse_device = 0,  ///< sparse, the whole device on one environment at a time
  sparse_block,       ///< sparse, a block each
  factor_warp,        ///< kept as a factor, a warp each
  dense_large,        ///< dense, a wide block each, system in global memory
  dense_block,        ///< dense, a block each, system in shared memory
  dense_warp,         ///< dense, a warp each
  dense_tile,         ///< dense, a part of a warp each
  thread_large,       ///< dense, a lane each, where there are enough of them to fill the device
  thread_medium,      ///< dense, a lane each (up to six contacts of three rows)
  thread_small,       ///< dense, a lane each (up to four contacts)
  trivial,            ///< nothing to iterate: no rows, or refused
};
inline constexpr int kSizeClasses = 11;

/// Most rows of an environment of each dense class, by SizeClass; 0: nothing is of that class. A dense environment is
/// of the last class in the order of SizeClass whose limit holds it.
struct ClassLimits {
  Index rows[kSizeClasses] = {0, 0, 0, 1024, 160, 72, 36, 0, 18, 12, 0};

  [[nodiscard]] STICTION_HD constexpr Index of(SizeClass size_class) const {
    return rows[static_cast<int>(size_class)];
  }
  /// These limits, with `most` for that class.
  [[nodiscard]] constexpr ClassLimits with(SizeClass size_class, Index most) const {
    ClassLimits limits = *this;
    limits.rows[static_cast<int>(size_class)] = most;
    return limits;
  }
  /// These limits, but the smallest environments are of class `finest`.
  [[nodiscard]] constexpr ClassLimits from(SizeClass finest) const {
    ClassLimits limits = *this;
    for (int k = static_cast<int>(finest) + 1; k < kSizeClasses; ++k) limits.rows[k] = 0;
    return limits;
  }
  /// Most rows that go to classes of smaller environments.
  [[nodiscard]] constexpr Index below(SizeClass size_class) const {
    Index most = 0;
    for (int k = static_cast<int>(size_class) + 1; k < kSizeClasses; ++k) most = rows[k] > most ? rows[k] : most;
    return most;
  }
  /// Returns true if dense environments of any size are of this class.
  [[nodiscard]] constexpr bool holds(SizeClass size_class) const { return of(size_class) > below(size_class); }
};

/// Rows from which a sparse environment gets the whole device.
inline constexpr Index kWholeDeviceRows = 6144;

/// Classes are sorted further by size, so that within one the longest environments start first.
inline constexpr int kBucketsPerClass = 8;
inline constexpr int kSortKeys = kSizeClasses * kBucketsPerClass;

STICTION_HD constexpr SizeClass size_class(EnvPath path, Index rows, const ClassLimits& limits = {}) {
  if (path == EnvPath::empty) return SizeClass::trivial;
  if (path == EnvPath::sparse) return rows >= kWholeDeviceRows ? SizeClass::sparse_device : SizeClass::sparse_block;
  if (path == EnvPath::factor) return SizeClass::factor_warp;
  int smallest = static_cast<int>(SizeClass::thread_small);
  while (rows > limits.rows[smallest]) --smallest;
  return static_cast<SizeClass>(smallest);
}

/// Returns the key of an environment in the order of execution: class, then size. Environments without a limit are
/// grouped by the power of two of their rows, dense ones by eighths of their class's limit.
STICTION_HD constexpr int sort_key(SizeClass size_class, Index rows, const ClassLimits& limits = {}) {
  int bucket = 0;
  if (size_class <= SizeClass::factor_warp) {
    bucket = kBucketsPerClass - 1;
    for (Index limit = size_class == SizeClass::sparse_device ? kWholeDeviceRows : 64; limit < rows && bucket > 0;
         limit *= 2)
      --bucket;
  } else if (size_class != SizeClass::trivial) {
    const Index limit = limits.of(size_class);
    bucket = static_cast<int>((limit - rows) * kBucketsPerClass / limit);
  }
  return static_cast<int>(size_class) * kBucketsPerClass + bucket;
}

}  // namespace stiction
