#pragma once

#include <cstdint>
#include <vector>

#include "stiction/bodies.hpp"

namespace stiction::c {

/// Structure from which the plan of a host batch was made, to tell if the plan still holds.
class BodyStructure {
 public:
  /// Copies it from a batch that was planned, and so is sound. `with_depth`: contacts over a capacity are left out by
  /// it.
  template <class Real>
  BodyStructure(const BodyBatchView<Real>& batch, bool with_depth);

  /// Returns true if the batch has this structure. Reads no array that a planned batch does not have.
  template <class Real>
  [[nodiscard]] bool is_of(const BodyBatchView<Real>& batch) const;

 private:
  bool has_kinematic_;
  std::vector<Offset> env_body_offsets_, env_contact_offsets_;
  std::vector<Index> body_a_, body_b_;
  std::vector<std::uint8_t> kinematic_;
  std::vector<double> depth_;  ///< either precision, exactly
};

}  // namespace stiction::c
