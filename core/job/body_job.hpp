#pragma once

#include "core/job/body_plan_view.hpp"
#include "stiction/bodies.hpp"

namespace stiction {

/// Value for boxed friction in templates over the law of contacts (docs/math/box_friction.md). Its cone's kind is
/// boxed. Contacts of bodies are all of one kind, and code of the other laws does not know of this one.
inline constexpr Law kBoxFriction = static_cast<Law>(2);
/// Laws that contacts of bodies may have.
inline constexpr int kContactLaws = 3;

/// Returns the law of a solve's contacts.
STICTION_HD Law contact_law(const BodySolverOptions& options) {
  return options.box_friction ? kBoxFriction : options.law;
}

/// One body solve as plain data, which crosses into code compiled for an instruction set or a device.
template <class Real>
struct BodyJob {
  BodyBatchView<Real> batch;
  BodyPlanView plan;
  BodySolutionView<Real> solution;
  const Real* warm_start;
  TimeStepping stepping;
  BodySolverOptions options;
};

}  // namespace stiction
