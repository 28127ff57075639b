#pragma once

/// \file
/// The arrays of batch views, each listed once: copies, checks and bindings go through these lists.
///
/// A function f gets a BatchArray and that array of every view in `each`. These may be views of either precision, or
/// structs whose fields have the same names: vectors, or the pointers of the C API.

#include <vector>

#include "stiction/bodies.hpp"
#include "stiction/jacobian.hpp"

namespace stiction {

/// One array of a batch. Counts come as a caller wrote them and are checked later, so a length is in [0, 2^60] whatever
/// they are.
struct BatchArray {
  /// `per_item` entries for each of `count` items.
  constexpr BatchArray(const char* field, Offset count, bool nullable = false, Offset per_item = 1)
      : name(field), length(holdable(count) * per_item), optional(nullable), width(per_item) {}
  /// Offsets of `count` items and, at the end, of their elements.
  static constexpr BatchArray offsets(const char* field, Offset count, bool nullable) {
    BatchArray array(field, count, nullable);
    if (count >= 0) ++array.length;
    return array;
  }

  const char* name;  ///< the field's
  Offset length;     ///< entries
  bool optional;     ///< null means none, or there is nothing to read
  Offset width;      ///< entries of one body or contact

 private:
  /// The nearest count that memory can hold: an address has 48 bits.
  static constexpr Offset holdable(Offset count) {
    constexpr Offset most = Offset{1} << 48;
    return count < 0 ? 0 : (count < most ? count : most);
  }
};

/// Calls f with where cones are.
template <class F, class... Layouts>
void for_each_cone_array(const BatchLayout& batch, F&& f, Layouts&... each) {
  const Offset envs = batch.env_count, cones = batch.cone_count;
  f(BatchArray::offsets("env_row_offsets", envs, envs == 0), each.env_row_offsets...);
  f(BatchArray::offsets("env_cone_offsets", envs, envs == 0), each.env_cone_offsets...);
  f(BatchArray{"cone_kind", cones}, each.cone_kind...);
  f(BatchArray::offsets("cone_row_offsets", cones, envs == 0), each.cone_row_offsets...);
  f(BatchArray{"cone_group", cones, true}, each.cone_group...);
}

/// Calls f with the arrays given for each environment.
template <class F, class... Layouts>
void for_each_env_array(const BatchLayout& batch, F&& f, Layouts&... each) {
  const Offset envs = batch.env_count;
  f(BatchArray{"env_flags", envs, true}, each.env_flags...);
  f(BatchArray{"env_tolerance", envs, true}, each.env_tolerance...);
  f(BatchArray{"env_max_iterations", envs, true}, each.env_max_iterations...);
}

/// Calls f with how much of its room each environment uses.
template <class F, class... Layouts>
void for_each_count_array(const BatchLayout& batch, F&& f, Layouts&... each) {
  f(BatchArray{"env_row_counts", batch.env_count, true}, each.env_row_counts...);
  f(BatchArray{"env_cone_counts", batch.env_count, true}, each.env_cone_counts...);
}

/// Calls f with bounds and compliance of the rows; `frictions` is the length of mu.
template <class F, class... Batches>
void for_each_limit_array(Offset rows, Offset frictions, F&& f, Batches&... each) {
  f(BatchArray{"R", rows}, each.R...);
  f(BatchArray{"mu", frictions}, each.mu...);
  f(BatchArray{"lo", rows}, each.lo...);
  f(BatchArray{"hi", rows}, each.hi...);
}

/// Calls f with the numbers of a batch whose rows share `frictions` numbers mu.
template <class Real, class F, class... Numbers>
void for_each_number_array(const ContactBatchView<Real>& batch, Offset frictions, F&& f, Numbers&... each) {
  const bool factored = batch.factor_offsets != nullptr;
  f(BatchArray{"A", batch.nonzero_count}, each.A...);
  f(BatchArray{"factor", factored ? batch.factor_count : 0, !factored}, each.factor...);
  f(BatchArray{"b", batch.row_count}, each.b...);
  for_each_limit_array(batch.row_count, frictions, f, each...);
}

/// Calls f with cotangents or tangents of a batch's numbers (stiction/derivative.hpp).
template <class Real, class F, class... Numbers>
void for_each_change_array(const ContactBatchView<Real>& batch, F&& f, Numbers&... each) {
  for_each_number_array(batch, batch.row_count, f, each...);
}
/// Calls f with cotangents or tangents of a Jacobian batch's numbers.
template <class Real, class F, class... Numbers>
void for_each_change_array(const JacobianBatchView<Real>& batch, F&& f, Numbers&... each) {
  f(BatchArray{"J", batch.entry_count}, each.J...);
  f(BatchArray{"M", batch.mass_count}, each.M...);
  f(BatchArray{"v_free", batch.dof_count}, each.v_free...);
  f(BatchArray{"target", batch.row_count, true}, each.target...);
  for_each_limit_array(batch.row_count, batch.row_count, f, each...);
}

/// Calls f with all that a ContactBatch holds.
template <class Real, class F, class... Batches>
void for_each_held_array(const ContactBatchView<Real>& batch, F&& f, Batches&... each) {
  for_each_cone_array(batch, f, each...);
  for_each_env_array(batch, f, each...);
  f(BatchArray::offsets("row_offsets", batch.row_count, batch.env_count == 0), each.row_offsets...);
  f(BatchArray{"column", batch.columns_stored()}, each.column...);
  f(BatchArray::offsets("factor_offsets", batch.env_count, true), each.factor_offsets...);
  for_each_number_array(batch, batch.mu_offsets != nullptr ? batch.mu_count : batch.row_count, f, each...);
}

/// Calls f with every array of a view.
template <class Real, class F, class... Batches>
void for_each_array(const ContactBatchView<Real>& batch, F&& f, Batches&... each) {
  for_each_held_array(batch, f, each...);
  for_each_count_array(batch, f, each...);
  f(BatchArray{"row_counts", batch.row_count, true}, each.row_counts...);
  f(BatchArray{"column_offsets", batch.row_count, true}, each.column_offsets...);
  f(BatchArray{"mu_offsets", batch.row_count, true}, each.mu_offsets...);
}

/// Calls f with all that a JacobianBatch holds.
template <class Real, class F, class... Batches>
void for_each_held_array(const JacobianBatchView<Real>& batch, F&& f, Batches&... each) {
  const Offset envs = batch.env_count;
  for_each_cone_array(batch, f, each...);
  f(BatchArray::offsets("env_dof_offsets", envs, envs == 0), each.env_dof_offsets...);
  f(BatchArray::offsets("env_mass_offsets", envs, envs == 0), each.env_mass_offsets...);
  f(BatchArray::offsets("row_offsets", batch.row_count, envs == 0), each.row_offsets...);
  f(BatchArray{"column", batch.entry_count, true}, each.column...);
  for_each_change_array(batch, f, each...);
}

/// Calls f with every array of a view.
template <class Real, class F, class... Batches>
void for_each_array(const JacobianBatchView<Real>& batch, F&& f, Batches&... each) {
  for_each_held_array(batch, f, each...);
  for_each_env_array(batch, f, each...);
  for_each_count_array(batch, f, each...);
}

/// Calls f with the arrays of bodies.
template <class F, class... Batches>
void for_each_body_array(Offset bodies, F&& f, Batches&... each) {
  f(BatchArray{"inv_mass", bodies}, each.inv_mass...);
  f(BatchArray{"inv_inertia", bodies, false, 6}, each.inv_inertia...);
  f(BatchArray{"twist", bodies, false, 6}, each.twist...);
  f(BatchArray{"twist_change", bodies, true, 6}, each.twist_change...);
  f(BatchArray{"kinematic", bodies, true}, each.kinematic...);
}

/// Calls f with the arrays of contacts of bodies.
template <class F, class... Batches>
void for_each_contact_array(Offset contacts, F&& f, Batches&... each) {
  f(BatchArray{"body_a", contacts}, each.body_a...);
  f(BatchArray{"body_b", contacts}, each.body_b...);
  f(BatchArray{"arm_a", contacts, false, 3}, each.arm_a...);
  f(BatchArray{"arm_b", contacts, false, 3}, each.arm_b...);
  f(BatchArray{"normal", contacts, false, 3}, each.normal...);
  f(BatchArray{"mu", contacts}, each.mu...);
  f(BatchArray{"depth", contacts}, each.depth...);
  f(BatchArray{"restitution", contacts}, each.restitution...);
}

/// Calls f with every array of a view that a solve reads: all but contact_id.
template <class Real, class F, class... Batches>
void for_each_array(const BodyBatchView<Real>& batch, F&& f, Batches&... each) {
  const Offset envs = batch.env_count;
  f(BatchArray::offsets("env_body_offsets", envs, envs == 0), each.env_body_offsets...);
  f(BatchArray::offsets("env_contact_offsets", envs, envs == 0), each.env_contact_offsets...);
  for_each_body_array(batch.body_count, f, each...);
  for_each_contact_array(batch.contact_count, f, each...);
}

/// Name of the first array that a batch needs and does not have; null if it has all.
template <class Batch>
const char* missing_array(const Batch& batch) {
  const char* missing = nullptr;
  for_each_array(
      batch,
      [&missing](const BatchArray& what, const auto* array) {
        if (missing == nullptr && array == nullptr && !what.optional && what.length > 0) missing = what.name;
      },
      batch);
  return missing;
}

/// Points a view's array at a vector: f of the lists above, for a view and a struct of vectors. An empty vector of an
/// array that may be null leaves null.
struct PointAt {
  /// Points `to` at `from`.
  template <class T>
  void operator()(const BatchArray& what, const T*& to, const std::vector<T>& from) const {
    to = what.optional && from.empty() ? nullptr : from.data();
  }
};

}  // namespace stiction
