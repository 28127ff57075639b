// Compiled as kernels are.
#include "distributed/world/body_boxes.hpp"

#include "core/algorithm/collision/detect.hpp"

namespace stiction {

inline namespace STICTION_ISA {

namespace {

template <class Real>
distributed::BodyBox box_of_shape(const WorldJob<Real>& job, Index shape) {
  const MovingShape<Real> moving = pose_shape(job, 0, shape);
  const ShapePlace place = place_of(moving, job.model.margin);
  distributed::BodyBox box;
  if (place == ShapePlace::nowhere) return box;
  if (place == ShapePlace::everywhere) {
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = -distributed::BodyBox::kFar;
      box.high[axis] = distributed::BodyBox::kFar;
    }
    return box;
  }
  const Box3<Real> near = box_of(moving, job.model.margin);
  return {{static_cast<double>(near.low.x), static_cast<double>(near.low.y), static_cast<double>(near.low.z)},
          {static_cast<double>(near.high.x), static_cast<double>(near.high.y), static_cast<double>(near.high.z)}};
}

template <class Real>
void find_boxes(const WorldJob<Real>& job, std::span<distributed::BodyBox> boxes) {
  SerialTeam team;
  prepare_world(team, job, 0);
  for (Index body = 0; body < job.model.bodies; ++body) {
    distributed::BodyBox& box = boxes[static_cast<std::size_t>(body)];
    box = {};
    const BodyShapes& own = shapes_of_body(job.model, body);
    for (Index shape = own.begin; shape < own.end; ++shape) box.add(box_of_shape(job, shape));
  }
}

}  // namespace

}  // namespace STICTION_ISA

namespace distributed {

void find_body_boxes(const WorldJob<float>& job, std::span<BodyBox> boxes) {
  find_boxes(job, boxes);
}
void find_body_boxes(const WorldJob<double>& job, std::span<BodyBox> boxes) {
  find_boxes(job, boxes);
}

}  // namespace distributed

}  // namespace stiction
