#pragma once

#include "stiction/types.hpp"

namespace stiction {

/// A body plan's arrays as kernels read them (host or device memory); shapes in core/plan/body_plan.hpp.
struct BodyPlanView {
  const Index* kept = nullptr;
  const Index* contact_order = nullptr;
  const Index* sides = nullptr;
  const Index* vertex_offsets = nullptr;
  const Index* color_offsets = nullptr;
  const Index* color_count = nullptr;
  const Index* body_offsets = nullptr;
  const Index* body_contacts = nullptr;
  const Index* newton_stream = nullptr;
  const Offset* newton_offsets = nullptr;
};

}  // namespace stiction
