#pragma once

#include "core/job/cone_counts.hpp"

namespace stiction {

/// Colour of a vertex that has none yet.
inline constexpr Index kUncolored = -1;

/// A plan's arrays as kernels read them (host or device memory); shapes in core/plan/plan.hpp.
struct PlanView {
  const EnvPath* path = nullptr;
  const ConeCounts* counts = nullptr;
  const Index* cone_order = nullptr;
  const Offset* env_vertex_offsets = nullptr;
  const Index* vertex_offsets = nullptr;
  const Offset* env_color_offsets = nullptr;
  const Index* color_offsets = nullptr;
  const Index* color_count = nullptr;
};

}  // namespace stiction
