#pragma once

#include <utility>

#include "stiction/bodies.hpp"

namespace stiction {

/// Name of the first array that a body batch needs and does not have; null if it has all. `with_numbers`: also those
/// that only a solve reads.
template <class Real>
const char* missing_array(const BodyBatchView<Real>& batch, bool with_numbers) {
  if (batch.contact_count > 0) {
    if (batch.body_a == nullptr) return "body_a";
    if (batch.body_b == nullptr) return "body_b";
  }
  if (!with_numbers) return nullptr;
  if (batch.body_count > 0) {
    for (const auto& [name, array] :
         {std::pair("inv_mass", batch.inv_mass), {"inv_inertia", batch.inv_inertia}, {"twist", batch.twist}}) {
      if (array == nullptr) return name;
    }
  }
  if (batch.contact_count > 0) {
    for (const auto& [name, array] : {std::pair("arm_a", batch.arm_a),
                                      {"arm_b", batch.arm_b},
                                      {"normal", batch.normal},
                                      {"mu", batch.mu},
                                      {"depth", batch.depth},
                                      {"restitution", batch.restitution}}) {
      if (array == nullptr) return name;
    }
  }
  return nullptr;
}

}  // namespace stiction
