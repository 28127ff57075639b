#pragma once

#include <string>

#include "core/runtime/check/expect.hpp"
#include "stiction/batch_arrays.hpp"

/// Checks of a batch of J and M whose arrays are out of sight.
namespace stiction {

inline void check_array(const char* name, const void* array, Offset length) {
  if (length > 0 && array == nullptr)
    refuse(std::string(name) + " is null: give it room for " + std::to_string(length) + " entries");
}

template <class Real>
void check_arrays(const JacobianBatchView<Real>& batch) {
  for (const Offset count : {batch.dof_count, batch.entry_count, batch.mass_count, Offset{batch.mass_block}})
    if (count < 0) refuse("a count of the batch is " + std::to_string(count) + ": counts must be >= 0");
  if (const char* name = missing_array(batch); name != nullptr)
    refuse(std::string(name) + " is null; point it to the batch's array");
}

}  // namespace stiction
