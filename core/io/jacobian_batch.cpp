#include <cmath>
#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

#include "core/base/fp_env.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::io {

namespace {

std::size_t at(Offset index) {
  return static_cast<std::size_t>(index);
}

[[noreturn]] void refuse(const std::string& message) {
  throw Error(ErrorCode::invalid_argument, message);
}

void require_length(const char* name, std::size_t got, std::size_t expected) {
  if (got != expected)
    refuse("recording." + std::string(name) + " has " + std::to_string(got) + " elements, expected " +
           std::to_string(expected));
}

void require_entries(const char* name, const Csr& matrix, std::size_t rows) {
  const std::string matrix_name(name);
  require_length((matrix_name + ".ptr").c_str(), matrix.ptr.size(), rows + 1);
  require_length((matrix_name + ".col").c_str(), matrix.col.size(), at(matrix.ptr.back()));
  require_length((matrix_name + ".val").c_str(), matrix.val.size(), at(matrix.ptr.back()));
}

void require_dynamics(const Recording& recording) {
  if (recording.J.ptr.empty() || recording.M.ptr.empty() || recording.v_free.empty())
    refuse("the recording has no J and M with v_free: solve it by its matrix A");
  const auto& arrays = recording.batch.arrays();
  require_length("env_dof_offsets", recording.env_dof_offsets.size(), arrays.env_row_offsets.size());
  const std::size_t dofs = at(recording.env_dof_offsets.back());
  require_length("v_free", recording.v_free.size(), dofs);
  require_entries("J", recording.J, arrays.b.size());
  require_entries("M", recording.M, dofs);
  if (!recording.row_target.empty()) require_length("row_target", recording.row_target.size(), arrays.b.size());
}

/// Returns true if all of M lies in blocks of that size on the diagonals of environments.
bool fits_blocks(const Recording& recording, Offset block) {
  for (std::size_t env = 0; env + 1 < recording.env_dof_offsets.size(); ++env) {
    const Offset first = recording.env_dof_offsets[env], end = recording.env_dof_offsets[env + 1];
    if ((end - first) % block != 0) return false;
    for (Offset dof = first; dof < end; ++dof)
      for (Offset k = recording.M.ptr[at(dof)]; k < recording.M.ptr[at(dof) + 1]; ++k)
        if (recording.M.col[at(k)] / block != (dof - first) / block) return false;
  }
  return true;
}

/// 0: dense.
Index mass_block(const Recording& recording) {
  for (const Index block : {1, 3, 6})
    if (fits_blocks(recording, block)) return block;
  return 0;
}

template <class Real>
std::vector<Real> part(const std::vector<double>& of, Offset begin, Offset end) {
  std::vector<Real> numbers;
  if (of.empty()) return numbers;
  for (Offset i = begin; i < end; ++i) numbers.push_back(static_cast<Real>(of[at(i)]));
  return numbers;
}

/// Degrees of freedom of the largest M that is written out as a dense matrix, of 512 MB.
constexpr Offset kMostDenseDofs = 8192;

/// M of an environment, block by block, whose lower triangle a solver reads. It therefore refuses one whose halves
/// differ by more than rounding, as some of FCLIB's do: it would solve another problem.
std::vector<double> mass_of(const Recording& recording, std::size_t number, Index block) {
  const Offset dof = recording.env_dof_offsets[number], count = recording.env_dof_offsets[number + 1] - dof;
  const Offset width = block == 0 ? count : block;
  if (block == 0 && count > kMostDenseDofs)
    refuse("M of environment " + std::to_string(number) + " has " + std::to_string(count) +
           " degrees of freedom and is not in blocks of 1, 3 or 6, at most " + std::to_string(kMostDenseDofs) +
           " are written out: solve it by its matrix A");
  std::vector<double> M(at(count * width), 0.0);
  for (Offset i = 0; i < count; ++i)
    for (Offset k = recording.M.ptr[at(dof + i)]; k < recording.M.ptr[at(dof + i) + 1]; ++k)
      M[at(i * width + recording.M.col[at(k)] % width)] += recording.M.val[at(k)];
  constexpr double kRounding = 1e-6;
  for (Offset i = 0; i < count; ++i)
    for (Offset column = 0; column < i % width; ++column) {
      const Offset j = i - i % width + column;
      const double scale = std::sqrt(std::abs(M[at(i * width + i % width)] * M[at(j * width + column)]));
      if (std::abs(M[at(i * width + column)] - M[at(j * width + i % width)]) > kRounding * scale)
        refuse("M of environment " + std::to_string(number) + " is not symmetric at (" + std::to_string(i) + ", " +
               std::to_string(j) + "): solve it by its matrix A");
    }
  return M;
}

template <class Real>
JacobianEnvironment<Real> environment(const Recording& recording, std::size_t number, Index block) {
  const auto& arrays = recording.batch.arrays();
  const Offset row = arrays.env_row_offsets[number], row_end = arrays.env_row_offsets[number + 1];
  const Offset dof = recording.env_dof_offsets[number], dof_end = recording.env_dof_offsets[number + 1];
  JacobianEnvironment<Real> env;
  for (Offset cone = arrays.env_cone_offsets[number]; cone < arrays.env_cone_offsets[number + 1]; ++cone)
    env.cones.push_back({arrays.cone_kind[at(cone)],
                         static_cast<Index>(arrays.cone_row_offsets[at(cone) + 1] - arrays.cone_row_offsets[at(cone)]),
                         arrays.cone_group.empty() ? -1 : arrays.cone_group[at(cone)]});
  const Offset first_entry = recording.J.ptr[at(row)];
  for (Offset i = row; i <= row_end; ++i)
    env.row_offsets.push_back(static_cast<Index>(recording.J.ptr[at(i)] - first_entry));
  for (Offset k = first_entry; k < recording.J.ptr[at(row_end)]; ++k) env.column.push_back(recording.J.col[at(k)]);
  env.J = part<Real>(recording.J.val, first_entry, recording.J.ptr[at(row_end)]);
  for (const double entry : mass_of(recording, number, block)) env.M.push_back(static_cast<Real>(entry));
  env.v_free = part<Real>(recording.v_free, dof, dof_end);
  env.target = part<Real>(recording.row_target, row, row_end);
  env.R = part<Real>(arrays.R, row, row_end);
  env.mu = part<Real>(arrays.mu, row, row_end);
  env.lo = part<Real>(arrays.lo, row, row_end);
  env.hi = part<Real>(arrays.hi, row, row_end);
  return env;
}

}  // namespace

template <class Real>
JacobianBatch<Real> jacobian_batch(const Recording& recording, std::span<const Offset> order) {
  const ScopedFpEnv fp_env;
  require_dynamics(recording);
  const Offset count = recording.batch.env_count();
  std::vector<Offset> all(at(count));
  std::iota(all.begin(), all.end(), Offset{0});
  const Index block = mass_block(recording);
  JacobianBatch<Real> batch(recording.batch.law(), MassForm::matrix, block);
  for (const Offset number : order.empty() ? std::span<const Offset>(all) : order) {
    if (number < 0 || number >= count)
      refuse("order names environment " + std::to_string(number) + ": there are " + std::to_string(count));
    batch.add(environment<Real>(recording, at(number), block));
  }
  return batch;
}

template JacobianBatch<float> jacobian_batch(const Recording&, std::span<const Offset>);
template JacobianBatch<double> jacobian_batch(const Recording&, std::span<const Offset>);

}  // namespace stiction::io
