#pragma once

#include <string>
#include <vector>

#include "core/facade/derivative_calls.hpp"
#include "core/facade/overlap.hpp"
#include "core/machine/derivative_machine.hpp"
#include "core/runtime/check/defects.hpp"

/// Arrays of calls of Derivative for contact batches.
namespace stiction {

/// Everything that an index is taken from, and the batch's arrays of numbers.
template <class Real>
void check_contacts(const ContactBatchView<Real>& batch, const GradientStatus* status, Offset count, Device device) {
  check_call(batch.space, device, status, batch.env_count, count);
  if (batch.space == MemorySpace::host) {
    const std::vector<Defect> defects = validate_structure(batch, 1);
    if (!defects.empty()) refuse(defects.front().message);
  }
  if (const char* name = missing_array(batch); name != nullptr)
    refuse("batch." + std::string(name) + " is null; point it to the array");
}

}  // namespace stiction
