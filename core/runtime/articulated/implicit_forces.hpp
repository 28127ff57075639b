#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "core/base/extents.hpp"
#include "core/job/articulated_job.hpp"
#include "stiction/articulated.hpp"
#include "stiction/error.hpp"

namespace stiction {

/// Marks the forces of which Euler's method takes those at the end of a step: damping, and those of `implicitfast`.
/// \throws Error(unsupported) for a body that is free and carries no joint, if its joint has damping or armature.
template <class T>
void put_implicit_forces(const ArticulatedDescription& from, VariedSet varies,
                         std::vector<ArticulatedJointData<T>>& joints, ArticulatedModelView<T>& view) {
  const auto damps = [](const ArticulatedDof& one) { return one.damping != 0; };
  view.damps_implicitly = from.damps_implicitly && ((varies & bit_of(VariedArray::dof_damping)) != 0 ||
                                                    std::any_of(from.dofs.begin(), from.dofs.end(), damps));
  if (!from.is_implicit_fast) return;
  const VariedSet gains = bit_of(VariedArray::actuator_gain) | bit_of(VariedArray::actuator_bias);
  const auto brakes = [](const ArticulatedActuator& one) { return one.gain[2] != 0 || one.bias[2] != 0; };
  view.acts_implicitly = (varies & gains) != 0 || std::any_of(from.actuators.begin(), from.actuators.end(), brakes);

  std::vector<Index> root(from.bodies.size()), moved(from.bodies.size());
  for (std::size_t b = 1; b < root.size(); ++b) {
    const Index parent = from.bodies[b].parent;
    root[b] = parent == 0 ? static_cast<Index>(b) : root[at(parent)];
    moved[at(root[b])] += from.bodies[b].joints;
  }
  const VariedSet diagonal = bit_of(VariedArray::dof_damping) | bit_of(VariedArray::dof_armature);
  const auto weighs = [](const ArticulatedDof& one) { return one.damping != 0 || one.armature != 0; };
  for (std::size_t j = 0; j < joints.size(); ++j) {
    ArticulatedJointData<T>& joint = joints[j];
    joint.is_lone = joint.kind == JointKind::free && moved[at(joint.body)] == 1;
    if (!joint.is_lone) continue;
    view.spins_implicitly = true;
    const auto first = from.dofs.begin() + joint.dof;
    if ((varies & diagonal) != 0 || std::any_of(first, first + 6, weighs))
      throw Error(
          ErrorCode::unsupported,
          "joints[" + std::to_string(j) +
              "] is free and its body carries no joint: with implicitfast it is stepped without damping and armature");
  }
}

}  // namespace stiction
