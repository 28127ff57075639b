#pragma once

#include "stiction/batch.hpp"

namespace stiction {

/// Appends the part of an environment in use. Its offsets must lead through the view's arrays. Arrays of offsets of
/// `to` begin with a zero, that of factors if the view has any.
template <class Real>
void append_environment(typename ContactBatch<Real>::Arrays& to, const ContactBatchView<Real>& from, Offset env) {
  const auto append = [](auto& target, const auto* source, Offset count) {
    if (count > 0) target.insert(target.end(), source, source + count);
  };
  const Offset cone = from.env_cone_offsets[env], row = from.env_row_offsets[env];
  const Index cones = from.env_cones(env), rows = from.env_rows(env);
  const Offset shift = to.env_row_offsets.back() - row;
  append(to.cone_kind, from.cone_kind + cone, cones);
  if (from.cone_group != nullptr) append(to.cone_group, from.cone_group + cone, cones);
  for (Index c = 1; c <= cones; ++c) to.cone_row_offsets.push_back(from.cone_row_offsets[cone + c] + shift);
  for (Offset r = row; r < row + rows; ++r) {
    const Index entries = from.row_entries(r);
    append(to.column, from.row_columns(r), entries);
    append(to.A, from.A + from.row_offsets[r], entries);
    to.row_offsets.push_back(static_cast<Offset>(to.A.size()));
  }
  if (from.mu_offsets == nullptr) {
    append(to.mu, from.mu + row, rows);
  } else {
    // Places in a shared mu need be sound where there is friction alone.
    for (Offset c = cone; c < cone + cones; ++c)
      for (Offset r = from.cone_row_offsets[c]; r < from.cone_row_offsets[c + 1]; ++r) {
        const bool rubs = carries_friction(from.cone_kind[c]) && r != from.normal_row(c);
        to.mu.push_back(rubs ? from.mu[from.mu_offsets[r]] : Real(0));
      }
  }
  append(to.b, from.b + row, rows);
  append(to.R, from.R + row, rows);
  append(to.lo, from.lo + row, rows);
  append(to.hi, from.hi + row, rows);
  if (from.factor_offsets != nullptr) {
    const Offset first = from.factor_offsets[env];
    append(to.factor, from.factor + first, from.factor_offsets[env + 1] - first);
    to.factor_offsets.push_back(static_cast<Offset>(to.factor.size()));
  }
  to.env_row_offsets.push_back(static_cast<Offset>(to.b.size()));
  to.env_cone_offsets.push_back(static_cast<Offset>(to.cone_kind.size()));
  if (from.env_flags != nullptr) to.env_flags.push_back(from.env_flags[env]);
  if (from.env_tolerance != nullptr) to.env_tolerance.push_back(from.env_tolerance[env]);
  if (from.env_max_iterations != nullptr) to.env_max_iterations.push_back(from.env_max_iterations[env]);
}

}  // namespace stiction
