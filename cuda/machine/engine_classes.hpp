#pragma once

#include "core/job/cone_counts.hpp"
#include "core/job/size_class.hpp"
#include "stiction/solver.hpp"

/// Facts about size classes by which the engine makes room for them and launches them.
namespace stiction::cuda {

/// Lanes of a team that looks at one environment's structure.
constexpr int kPlanLanes = 32;
/// Lanes of the team that sorts environments into classes.
constexpr int kSortLanes = 256;

inline bool is_sparse(SizeClass size_class) {
  return size_class == SizeClass::sparse_block || size_class == SizeClass::sparse_device;
}

inline bool is_dense(SizeClass size_class) {
  return size_class >= SizeClass::dense_large && size_class <= SizeClass::thread_small;
}

inline bool is_thread_per_env(SizeClass size_class) {
  return size_class >= SizeClass::thread_large && size_class <= SizeClass::thread_small;
}

/// Returns true if environments can be sparse: so large that they are, or with semidefinite cones.
inline bool may_be_sparse(const Capacity& capacity) {
  return choose_path(capacity.env_rows, 0, capacity.semidefinite) == EnvPath::sparse;
}

}  // namespace stiction::cuda
