#pragma once

#include <vector>

#include "core/base/extents.hpp"
#include "core/job/articulated_job.hpp"

/// Arrays of a model that environments are observed by.
namespace stiction {

/// Parts of joints in tendons, with the places of their coordinates.
template <class T>
std::vector<ArticulatedTendonTermData<T>> tendon_terms_of(const ArticulatedDescription& from,
                                                          const std::vector<ArticulatedJointData<T>>& joints) {
  std::vector<ArticulatedTendonTermData<T>> terms;
  for (const ArticulatedTendonTerm& one : from.tendon_terms) {
    const ArticulatedJointData<T>& joint = joints[at(one.joint)];
    terms.push_back({one.tendon, joint.q, joint.dof, static_cast<T>(one.coefficient)});
  }
  return terms;
}

/// Writes how many numbers of an environment each observed array has.
template <class T>
void put_observed_widths(const ArticulatedDescription& from, ArticulatedModelView<T>& view) {
  const auto bodies = static_cast<Index>(from.bodies.size()), dofs = static_cast<Index>(from.dofs.size());
  const auto put = [&](ObservedArray array, Index width) {
    view.observed_width[static_cast<std::size_t>(array)] = width;
  };
  put(ObservedArray::xpos, 3 * bodies);
  put(ObservedArray::xipos, 3 * bodies);
  put(ObservedArray::cinert, 10 * bodies);
  put(ObservedArray::cvel, 6 * bodies);
  put(ObservedArray::qfrc_actuator, dofs);
  put(ObservedArray::cfrc_ext, 6 * bodies);
  put(ObservedArray::ten_length, from.tendons);
  put(ObservedArray::ten_velocity, from.tendons);
}

}  // namespace stiction
