#pragma once

#include "core/job/plan_view.hpp"
#include "core/plan/plan.hpp"

namespace stiction::test {

/// A plan as kernels read it; valid while the plan lives.
inline PlanView view_of(const PlanData& plan) {
  PlanView view;
  view.path = plan.path.data();
  view.counts = plan.counts.data();
  view.cone_order = plan.cone_order.data();
  view.env_vertex_offsets = plan.env_vertex_offsets.data();
  view.vertex_offsets = plan.vertex_offsets.data();
  view.env_color_offsets = plan.env_color_offsets.data();
  view.color_offsets = plan.color_offsets.data();
  view.color_count = plan.color_count.data();
  return view;
}

}  // namespace stiction::test
