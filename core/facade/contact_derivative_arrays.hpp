#pragma once

#include <string>
#include <vector>

#include "core/facade/derivative_calls.hpp"
#include "core/facade/overlap.hpp"
#include "core/machine/derivative_machine.hpp"
#include "core/runtime/check/defects.hpp"

/// Arrays of calls of Derivative for contact batches.
namespace stiction {

inline void need_array(const char* name, const void* array, bool needed) {
  if (needed && array == nullptr) refuse(std::string(name) + " is null; point it to the array");
}

/// Everything that an index is taken from, and the batch's arrays of numbers.
template <class Real>
void check_contacts(const ContactBatchView<Real>& batch, const GradientStatus* status, Offset count, Device device) {
  check_call(batch.space, device, status, batch.env_count, count);
  if (batch.space == MemorySpace::host) {
    const std::vector<Defect> defects = validate_structure(batch, 1);
    if (!defects.empty()) refuse(defects.front().message);
  }
  const bool rows = batch.row_count > 0;
  need_array("batch.A", batch.A, batch.nonzero_count > 0);
  need_array("batch.factor", batch.factor, batch.factor_offsets != nullptr && batch.factor_count > 0);
  need_array("batch.b", batch.b, rows);
  need_array("batch.R", batch.R, rows);
  need_array("batch.mu", batch.mu, rows);
  need_array("batch.lo", batch.lo, rows);
  need_array("batch.hi", batch.hi, rows);
}

/// The arrays of a view of cotangents or changes of a batch.
template <class View>
auto arrays_by_number(const char* const (&names)[7], const View& view, Offset nonzeros, Offset factors, Offset rows,
                      Offset count) {
  return std::vector{
      NamedArray::of(names[0], view.A, count * nonzeros), NamedArray::of(names[1], view.factor, count * factors),
      NamedArray::of(names[2], view.b, count * rows),     NamedArray::of(names[3], view.R, count * rows),
      NamedArray::of(names[4], view.mu, count * rows),    NamedArray::of(names[5], view.lo, count * rows),
      NamedArray::of(names[6], view.hi, count * rows)};
}

/// Those that cotangents of a batch are written to.
template <class Real>
auto gradient_arrays(const BatchCotangentView<Real>& gradients, const ContactBatchView<Real>& batch, Offset count) {
  return arrays_by_number(
      {"gradients.A", "gradients.factor", "gradients.b", "gradients.R", "gradients.mu", "gradients.lo", "gradients.hi"},
      gradients, batch.nonzero_count, batch.factor_count, batch.row_count, count);
}

}  // namespace stiction
