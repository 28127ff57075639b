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
  thread_medium,      ///< dense, a lane each (up to six contacts of three rows)
  thread_small,       ///< dense, a lane each (up to four contacts)
  trivial,            ///< nothing to iterate: no rows, or refused
};
inline constexpr int kSizeClasses = 10;

/// Most rows of an environment of a dense class.
STICTION_HD constexpr Index class_rows(SizeClass size_class) {
  switch (size_class) {
    case SizeClass::dense_large:
      return 1024;
    case SizeClass::dense_block:
      return 160;
    case SizeClass::dense_warp:
      return 72;
    case SizeClass::dense_tile:
      return 36;
    case SizeClass::thread_medium:
      return 18;
    case SizeClass::thread_small:
      return 12;
    default:
      return 0;
  }
}

/// Rows from which a sparse environment gets the whole device.
inline constexpr Index kWholeDeviceRows = 6144;

/// Classes are sorted further by size, so that within one the longest environments start first.
inline constexpr int kBucketsPerClass = 8;
inline constexpr int kSortKeys = kSizeClasses * kBucketsPerClass;

STICTION_HD constexpr SizeClass size_class(EnvPath path, Index rows) {
  if (path == EnvPath::empty) return SizeClass::trivial;
  if (path == EnvPath::sparse) return rows >= kWholeDeviceRows ? SizeClass::sparse_device : SizeClass::sparse_block;
  if (path == EnvPath::factor) return SizeClass::factor_warp;
  int smallest = static_cast<int>(SizeClass::thread_small);
  while (rows > class_rows(static_cast<SizeClass>(smallest))) --smallest;
  return static_cast<SizeClass>(smallest);
}

/// Where an environment stands in the order of execution: class, then size. Environments without a limit are told apart
/// by the power of two of their rows, dense ones by eighths of their class's limit.
STICTION_HD constexpr int sort_key(SizeClass size_class, Index rows) {
  int bucket = 0;
  if (size_class <= SizeClass::factor_warp) {
    bucket = kBucketsPerClass - 1;
    for (Index limit = size_class == SizeClass::sparse_device ? kWholeDeviceRows : 64; limit < rows && bucket > 0;
         limit *= 2)
      --bucket;
  } else if (size_class != SizeClass::trivial) {
    const Index limit = class_rows(size_class);
    bucket = static_cast<int>((limit - rows) * kBucketsPerClass / limit);
  }
  return static_cast<int>(size_class) * kBucketsPerClass + bucket;
}

}  // namespace stiction
