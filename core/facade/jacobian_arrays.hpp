#pragma once

#include <string>

#include "core/runtime/check/expect.hpp"
#include "stiction/jacobian.hpp"

/// What can be said about a batch of J and M whose arrays are out of sight.
namespace stiction {

inline void check_array(const char* name, const void* array, Offset length) {
  if (length > 0 && array == nullptr)
    refuse(std::string(name) + " is null: give it room for " + std::to_string(length) + " entries");
}

template <class Real>
void check_arrays(const JacobianBatchView<Real>& batch) {
  for (const Offset count : {batch.dof_count, batch.entry_count, batch.mass_count, Offset{batch.mass_block}})
    if (count < 0) refuse("a count of the batch is " + std::to_string(count) + ": counts must be >= 0");
  check_array("env_row_offsets", batch.env_row_offsets, batch.env_count);
  check_array("env_cone_offsets", batch.env_cone_offsets, batch.env_count);
  check_array("env_dof_offsets", batch.env_dof_offsets, batch.env_count);
  check_array("env_mass_offsets", batch.env_mass_offsets, batch.env_count);
  check_array("cone_row_offsets", batch.cone_row_offsets, batch.env_count);
  check_array("row_offsets", batch.row_offsets, batch.env_count);
  check_array("cone_kind", batch.cone_kind, batch.cone_count);
  check_array("J", batch.J, batch.entry_count);
  check_array("M", batch.M, batch.mass_count);
  check_array("v_free", batch.v_free, batch.dof_count);
  check_array("R", batch.R, batch.row_count);
  check_array("mu", batch.mu, batch.row_count);
  check_array("lo", batch.lo, batch.row_count);
  check_array("hi", batch.hi, batch.row_count);
}

}  // namespace stiction
