#pragma once

#include "core/plan/body_plan.hpp"

namespace stiction {

/// Adds to a plan the data of Newton's method in body space for every environment (BodyPlanData::newton_stream). It
/// follows from the plan's own integers and `space` alone.
void add_newton_plan(BodyPlanData& plan, const BodySpaceOptions& space);

}  // namespace stiction
