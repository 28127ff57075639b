#pragma once

#include <limits>
#include <span>

#include "core/job/world_job.hpp"

namespace stiction::distributed {

/// Box that a body's shapes may reach within a step, with half the margin [m].
struct BodyBox {
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  double low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};  ///< holds nothing

  void add(const BodyBox& other) {
    for (int axis = 0; axis < 3; ++axis) {
      if (other.low[axis] < low[axis]) low[axis] = other.low[axis];
      if (other.high[axis] > high[axis]) high[axis] = other.high[axis];
    }
  }
  [[nodiscard]] bool overlaps(const BodyBox& other) const {
    for (int axis = 0; axis < 3; ++axis)
      if (!(low[axis] <= other.high[axis] && other.low[axis] <= high[axis])) return false;
    return true;
  }
};

/// Boxes of the bodies of a world of one environment. Shapes that pass bounds_overlap() have bodies whose boxes overlap
/// (core/algorithm/collision/shape_tree.hpp). Writes inv_inertia and twist_change, too.   (bodies)
void find_body_boxes(const WorldJob<float>& job, std::span<BodyBox> boxes);
void find_body_boxes(const WorldJob<double>& job, std::span<BodyBox> boxes);

}  // namespace stiction::distributed
