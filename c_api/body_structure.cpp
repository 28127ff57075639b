#include "c_api/body_structure.hpp"

#include <algorithm>

namespace stiction::c {

namespace {

template <class T>
std::vector<T> copied(const auto* array, Offset count) {
  return count == 0 ? std::vector<T>() : std::vector<T>(array, array + count);
}

/// Returns true if an array is present and has the same contents.
template <class T>
bool equal(const std::vector<T>& kept, const auto* array) {
  return kept.empty() || (array != nullptr && std::equal(kept.begin(), kept.end(), array));
}

}  // namespace

template <class Real>
BodyStructure::BodyStructure(const BodyBatchView<Real>& batch, bool with_depth)
    : has_kinematic_(batch.kinematic != nullptr),
      env_body_offsets_(copied<Offset>(batch.env_body_offsets, batch.env_count + 1)),
      env_contact_offsets_(copied<Offset>(batch.env_contact_offsets, batch.env_count + 1)),
      body_a_(copied<Index>(batch.body_a, batch.contact_count)),
      body_b_(copied<Index>(batch.body_b, batch.contact_count)),
      kinematic_(copied<std::uint8_t>(batch.kinematic, has_kinematic_ ? batch.body_count : 0)),
      depth_(copied<double>(batch.depth, with_depth ? batch.contact_count : 0)) {}

template <class Real>
bool BodyStructure::is_of(const BodyBatchView<Real>& batch) const {
  return batch.env_count + 1 == static_cast<Offset>(env_body_offsets_.size()) &&
         batch.body_count == env_body_offsets_.back() && batch.contact_count == env_contact_offsets_.back() &&
         has_kinematic_ == (batch.kinematic != nullptr) && equal(env_body_offsets_, batch.env_body_offsets) &&
         equal(env_contact_offsets_, batch.env_contact_offsets) && equal(body_a_, batch.body_a) &&
         equal(body_b_, batch.body_b) && equal(kinematic_, batch.kinematic) && equal(depth_, batch.depth);
}

template BodyStructure::BodyStructure(const BodyBatchView<float>&, bool);
template BodyStructure::BodyStructure(const BodyBatchView<double>&, bool);
template bool BodyStructure::is_of(const BodyBatchView<float>&) const;
template bool BodyStructure::is_of(const BodyBatchView<double>&) const;

}  // namespace stiction::c
