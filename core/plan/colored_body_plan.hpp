#pragma once

#include <functional>
#include <span>

#include "core/plan/body_plan.hpp"

namespace stiction {

/// The bodies that a vertex pushes, by number; -1 for one that is not pushed.
struct PushedBodies {
  Index low, high;
};

/// Writes the colour of each vertex, and returns how many colours there are. Some may have no vertex: ranks that plan a
/// scene together see a part of it each (docs/howto/ranks.md).
using ColorVertices = std::function<Index(std::span<const PushedBodies> vertices, std::span<Index> colors)>;

/// Plans a host batch of one environment as make_body_plan() does, with colours that the caller chooses. Vertices are
/// given in order of their contacts.
template <class Real>
BodyPlanData make_body_plan(const BodyBatchView<Real>& batch, const ColorVertices& color);

}  // namespace stiction
