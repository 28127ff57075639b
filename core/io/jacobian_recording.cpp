#include <cstddef>
#include <numeric>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/fp_env.hpp"
#include "stiction/error.hpp"
#include "stiction/io.hpp"

namespace stiction::io {

namespace {

/// A row of J as it is stored, entries that are zero included.
template <class Real>
void add_row(const JacobianBatchView<Real>& batch, Offset env, Offset row, Csr& J) {
  const Offset first = batch.row_offsets[row];
  const Offset count = batch.column != nullptr ? batch.row_offsets[row + 1] - first : Offset{batch.env_dofs(env)};
  for (Offset k = 0; k < count; ++k) {
    J.col.push_back(batch.column != nullptr ? batch.column[first + k] : static_cast<Index>(k));
    J.val.push_back(static_cast<double>(batch.J[first + k]));
  }
  J.ptr.push_back(static_cast<Offset>(J.val.size()));
}

/// An entry of a block of M, of whose numbers, or of whose factor's, the lower triangle counts.
template <class Real>
double mass_entry(const JacobianBatchView<Real>& batch, const Real* block, Offset width, Offset i, Offset j) {
  if (i < j) std::swap(i, j);
  if (batch.mass_form == MassForm::matrix) return static_cast<double>(block[i * width + j]);
  double sum = 0.0;
  for (Offset k = 0; k <= j; ++k)
    sum += static_cast<double>(block[i * width + k]) * static_cast<double>(block[j * width + k]);
  return sum;
}

/// All entries of the blocks, so that a reader finds the same blocks again.
template <class Real>
void add_mass(const JacobianBatchView<Real>& batch, Offset env, Csr& M) {
  const Offset dofs = batch.env_dofs(env), width = batch.mass_block == 0 ? dofs : Offset{batch.mass_block};
  for (Offset dof = 0; dof < dofs; ++dof) {
    const Offset first = dof - dof % width;
    const Real* const block = batch.M + batch.env_mass_offsets[env] + first * width;
    for (Offset j = 0; j < width; ++j) {
      M.col.push_back(static_cast<Index>(first + j));
      M.val.push_back(mass_entry(batch, block, width, dof % width, j));
    }
    M.ptr.push_back(static_cast<Offset>(M.val.size()));
  }
}

}  // namespace

template <class Real>
void keep_dynamics(Recording& recording, const JacobianBatchView<Real>& batch, std::span<const Offset> environments) {
  const ScopedFpEnv fp_env;
  if (batch.space != MemorySpace::host)
    throw Error(ErrorCode::invalid_argument, "keep_dynamics: the batch is in device memory: copy it to the host");
  std::vector<Offset> all(environments.begin(), environments.end());
  if (environments.empty()) {
    all.resize(static_cast<std::size_t>(batch.env_count));
    std::iota(all.begin(), all.end(), Offset{0});
  }
  Recording kept;
  kept.env_dof_offsets = kept.J.ptr = kept.M.ptr = {0};
  for (const Offset env : all) {
    if (env < 0 || env >= batch.env_count)
      throw Error(ErrorCode::invalid_argument, "keep_dynamics: environments names number " + std::to_string(env) +
                                                   ": there are " + std::to_string(batch.env_count));
    const Offset first = batch.env_row_offsets[env];
    for (Offset row = first; row < first + batch.env_rows(env); ++row) {
      add_row(batch, env, row, kept.J);
      kept.row_target.push_back(batch.target != nullptr ? static_cast<double>(batch.target[row]) : 0.0);
    }
    add_mass(batch, env, kept.M);
    for (Offset dof = batch.env_dof_offsets[env]; dof < batch.env_dof_offsets[env + 1]; ++dof)
      kept.v_free.push_back(static_cast<double>(batch.v_free[dof]));
    kept.env_dof_offsets.push_back(static_cast<Offset>(kept.v_free.size()));
  }
  recording.env_dof_offsets = std::move(kept.env_dof_offsets);
  recording.J = std::move(kept.J);
  recording.M = std::move(kept.M);
  recording.v_free = std::move(kept.v_free);
  recording.row_target = std::move(kept.row_target);
}

template void keep_dynamics(Recording&, const JacobianBatchView<float>&, std::span<const Offset>);
template void keep_dynamics(Recording&, const JacobianBatchView<double>&, std::span<const Offset>);

}  // namespace stiction::io
