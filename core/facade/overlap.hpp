#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "core/runtime/check/expect.hpp"
#include "stiction/bodies.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/solver.hpp"

/// Which memory a call reads and which it writes. A solve reads its inputs while other environments are written, and
/// judges answers by the inputs at the end. An output that lies in an input would be answered wrongly, and then be
/// judged by the input that it has overwritten.
namespace stiction {

/// An array of a call, under the name that the caller knows.
struct NamedArray {
  const char* name;
  const void* begin = nullptr;
  std::size_t bytes = 0;

  template <class T>
  static NamedArray of(const char* name, const T* array, Offset count) {
    return {name, array, array == nullptr ? 0 : static_cast<std::size_t>(count) * sizeof(T)};
  }
};

inline bool overlap(const NamedArray& a, const NamedArray& b) {
  const auto at = [](const NamedArray& array) { return reinterpret_cast<std::uintptr_t>(array.begin); };
  return a.bytes > 0 && b.bytes > 0 && at(a) < at(b) + b.bytes && at(b) < at(a) + a.bytes;
}

/// \throws Error(invalid_argument) that names an output and what it shares memory with: another output or an input.
inline void refuse_overlaps(std::span<const NamedArray> outputs, std::span<const NamedArray> inputs) {
  const auto check = [](const NamedArray& output, const NamedArray& other) {
    if (overlap(output, other))
      refuse(std::string(output.name) + " and " + other.name + " overlap in memory: give " + output.name +
             " memory of its own");
  };
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) check(outputs[i], outputs[k]);
    for (const NamedArray& input : inputs) check(outputs[i], input);
  }
}

template <class Real>
auto arrays_of(const ContactBatchView<Real>& batch) {
  const Offset envs = batch.env_count, rows = batch.row_count, cones = batch.cone_count;
  const Offset mus = batch.mu_offsets != nullptr ? batch.mu_count : rows;
  return std::array{NamedArray::of("batch.env_row_offsets", batch.env_row_offsets, envs + 1),
                    NamedArray::of("batch.env_cone_offsets", batch.env_cone_offsets, envs + 1),
                    NamedArray::of("batch.env_row_counts", batch.env_row_counts, envs),
                    NamedArray::of("batch.env_cone_counts", batch.env_cone_counts, envs),
                    NamedArray::of("batch.env_flags", batch.env_flags, envs),
                    NamedArray::of("batch.env_tolerance", batch.env_tolerance, envs),
                    NamedArray::of("batch.env_max_iterations", batch.env_max_iterations, envs),
                    NamedArray::of("batch.cone_kind", batch.cone_kind, cones),
                    NamedArray::of("batch.cone_row_offsets", batch.cone_row_offsets, cones + 1),
                    NamedArray::of("batch.cone_group", batch.cone_group, cones),
                    NamedArray::of("batch.row_offsets", batch.row_offsets, rows + 1),
                    NamedArray::of("batch.row_counts", batch.row_counts, rows),
                    NamedArray::of("batch.column", batch.column, batch.columns_stored()),
                    NamedArray::of("batch.column_offsets", batch.column_offsets, rows),
                    NamedArray::of("batch.A", batch.A, batch.nonzero_count),
                    NamedArray::of("batch.factor_offsets", batch.factor_offsets, envs + 1),
                    NamedArray::of("batch.factor", batch.factor, batch.factor_count),
                    NamedArray::of("batch.b", batch.b, rows),
                    NamedArray::of("batch.R", batch.R, rows),
                    NamedArray::of("batch.mu", batch.mu, mus),
                    NamedArray::of("batch.mu_offsets", batch.mu_offsets, rows),
                    NamedArray::of("batch.lo", batch.lo, rows),
                    NamedArray::of("batch.hi", batch.hi, rows)};
}

template <class Real>
auto arrays_of(const JacobianBatchView<Real>& batch) {
  const Offset envs = batch.env_count, rows = batch.row_count, cones = batch.cone_count;
  return std::array{NamedArray::of("batch.env_row_offsets", batch.env_row_offsets, envs + 1),
                    NamedArray::of("batch.env_cone_offsets", batch.env_cone_offsets, envs + 1),
                    NamedArray::of("batch.env_dof_offsets", batch.env_dof_offsets, envs + 1),
                    NamedArray::of("batch.env_mass_offsets", batch.env_mass_offsets, envs + 1),
                    NamedArray::of("batch.env_row_counts", batch.env_row_counts, envs),
                    NamedArray::of("batch.env_cone_counts", batch.env_cone_counts, envs),
                    NamedArray::of("batch.env_flags", batch.env_flags, envs),
                    NamedArray::of("batch.env_tolerance", batch.env_tolerance, envs),
                    NamedArray::of("batch.env_max_iterations", batch.env_max_iterations, envs),
                    NamedArray::of("batch.cone_kind", batch.cone_kind, cones),
                    NamedArray::of("batch.cone_row_offsets", batch.cone_row_offsets, cones + 1),
                    NamedArray::of("batch.cone_group", batch.cone_group, cones),
                    NamedArray::of("batch.row_offsets", batch.row_offsets, rows + 1),
                    NamedArray::of("batch.column", batch.column, batch.entry_count),
                    NamedArray::of("batch.J", batch.J, batch.entry_count),
                    NamedArray::of("batch.M", batch.M, batch.mass_count),
                    NamedArray::of("batch.v_free", batch.v_free, batch.dof_count),
                    NamedArray::of("batch.target", batch.target, rows),
                    NamedArray::of("batch.R", batch.R, rows),
                    NamedArray::of("batch.mu", batch.mu, rows),
                    NamedArray::of("batch.lo", batch.lo, rows),
                    NamedArray::of("batch.hi", batch.hi, rows)};
}

template <class Real>
auto arrays_of(const BodyBatchView<Real>& batch) {
  const Offset envs = batch.env_count, bodies = batch.body_count, contacts = batch.contact_count;
  return std::array{NamedArray::of("batch.env_body_offsets", batch.env_body_offsets, envs + 1),
                    NamedArray::of("batch.env_contact_offsets", batch.env_contact_offsets, envs + 1),
                    NamedArray::of("batch.inv_mass", batch.inv_mass, bodies),
                    NamedArray::of("batch.inv_inertia", batch.inv_inertia, 6 * bodies),
                    NamedArray::of("batch.twist", batch.twist, 6 * bodies),
                    NamedArray::of("batch.twist_change", batch.twist_change, 6 * bodies),
                    NamedArray::of("batch.kinematic", batch.kinematic, bodies),
                    NamedArray::of("batch.body_a", batch.body_a, contacts),
                    NamedArray::of("batch.body_b", batch.body_b, contacts),
                    NamedArray::of("batch.arm_a", batch.arm_a, 3 * contacts),
                    NamedArray::of("batch.arm_b", batch.arm_b, 3 * contacts),
                    NamedArray::of("batch.normal", batch.normal, 3 * contacts),
                    NamedArray::of("batch.mu", batch.mu, contacts),
                    NamedArray::of("batch.depth", batch.depth, contacts),
                    NamedArray::of("batch.restitution", batch.restitution, contacts),
                    NamedArray::of("batch.contact_id", batch.contact_id, contacts)};
}

template <class Real>
auto arrays_of(const ContactBatchView<Real>& batch, const SolutionView<Real>& solution) {
  return std::array{NamedArray::of("solution.lambda", solution.lambda, batch.row_count),
                    NamedArray::of("solution.w", solution.w, batch.row_count),
                    NamedArray::of("solution.status", solution.status, batch.env_count)};
}

template <class Real>
auto arrays_of(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution) {
  return std::array{NamedArray::of("solution.lambda", solution.lambda, batch.row_count),
                    NamedArray::of("solution.w", solution.w, batch.row_count),
                    NamedArray::of("solution.velocity", solution.velocity, batch.dof_count),
                    NamedArray::of("solution.status", solution.status, batch.env_count)};
}

template <class Real>
auto arrays_of(const BodyBatchView<Real>& batch, const BodySolutionView<Real>& solution) {
  return std::array{NamedArray::of("solution.impulse", solution.impulse, 3 * batch.contact_count),
                    NamedArray::of("solution.twist", solution.twist, 6 * batch.body_count),
                    NamedArray::of("solution.w", solution.w, 3 * batch.contact_count),
                    NamedArray::of("solution.status", solution.status, batch.env_count)};
}

/// Of a first guess and the outputs. It may be the very array that it is a guess of: an environment's guess is read
/// before its answer is written.
inline void refuse_overlaps_of_guess(std::span<const NamedArray> outputs, std::size_t guessed,
                                     const NamedArray& guess) {
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (i != guessed || guess.begin != outputs[i].begin) refuse_overlaps(outputs.subspan(i, 1), std::span(&guess, 1));
}

/// Of a batch, where its answer goes, and the reactions that it starts from, which are the first output's.
template <class Batch, class Solution, class Real>
void refuse_overlaps(const Batch& batch, const Solution& solution, const Real* warm_start) {
  const auto outputs = arrays_of(batch, solution);
  refuse_overlaps(outputs, arrays_of(batch));
  refuse_overlaps_of_guess(outputs, 0, {"warm_start", warm_start, warm_start == nullptr ? 0 : outputs[0].bytes});
}
template <class Real>
void refuse_overlaps(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                     const JacobianStart<Real>& start) {
  refuse_overlaps(batch, solution, start.reactions);
  const auto outputs = arrays_of(batch, solution);
  constexpr std::size_t kVelocity = 2;
  refuse_overlaps_of_guess(outputs, kVelocity, NamedArray::of("start.velocities", start.velocities, batch.dof_count));
}

}  // namespace stiction
