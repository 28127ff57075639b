#pragma once

#include <vector>

#include "core/job/articulated_job.hpp"

/// Constants of a description as arrays, which environments may have of their own.
namespace stiction {

/// An environment's row of an array, as the description has it.
inline std::vector<double> constants_of(const ArticulatedDescription& from, VariedArray which) {
  std::vector<double> row;
  const auto put_all = [&](const auto& list, auto field) {
    for (const auto& one : list) row.push_back(one.*field);
  };
  const auto put_arrays = [&](const auto& list, auto field) {
    for (const auto& one : list) row.insert(row.end(), (one.*field).begin(), (one.*field).end());
  };
  switch (which) {
    case VariedArray::body_mass:
      put_all(from.bodies, &ArticulatedBody::mass);
      break;
    case VariedArray::body_inertia:
      put_arrays(from.bodies, &ArticulatedBody::inertia);
      break;
    case VariedArray::pair_friction:
      put_arrays(from.pairs, &ArticulatedPair::friction);
      break;
    case VariedArray::actuator_gain:
      put_arrays(from.actuators, &ArticulatedActuator::gain);
      break;
    case VariedArray::actuator_bias:
      put_arrays(from.actuators, &ArticulatedActuator::bias);
      break;
    case VariedArray::dof_damping:
      put_all(from.dofs, &ArticulatedDof::damping);
      break;
    case VariedArray::dof_armature:
      put_all(from.dofs, &ArticulatedDof::armature);
      break;
    case VariedArray::dof_friction_loss:
      put_all(from.dofs, &ArticulatedDof::friction_loss);
      break;
  }
  return row;
}

/// Writes how many numbers of an environment each array has.
template <class T>
void put_varied_widths(const ArticulatedDescription& from, ArticulatedModelView<T>& view) {
  for (std::size_t k = 0; k < kVariedArrays; ++k)
    view.varied_width[k] = static_cast<Index>(constants_of(from, static_cast<VariedArray>(k)).size());
}

}  // namespace stiction
