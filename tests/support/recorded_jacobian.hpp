#pragma once

#include <vector>

#include "stiction/io.hpp"
#include "stiction/jacobian.hpp"

namespace stiction::test {

/// The Jacobian form of a recording that has one: J by its stored entries, M as a dense matrix.
inline JacobianBatch<double> recorded_jacobian(const io::Recording& recording) {
  const auto& arrays = recording.batch.arrays();
  JacobianBatch<double> batch(recording.batch.law());
  for (std::size_t e = 0; e + 1 < arrays.env_row_offsets.size(); ++e) {
    JacobianEnvironment<double> env;
    const auto first = static_cast<std::size_t>(arrays.env_row_offsets[e]);
    const auto end = static_cast<std::size_t>(arrays.env_row_offsets[e + 1]);
    const auto dof = static_cast<std::size_t>(recording.env_dof_offsets[e]);
    const auto dofs = static_cast<std::size_t>(recording.env_dof_offsets[e + 1]) - dof;
    for (auto c = static_cast<std::size_t>(arrays.env_cone_offsets[e]);
         c < static_cast<std::size_t>(arrays.env_cone_offsets[e + 1]); ++c)
      env.cones.push_back(
          {arrays.cone_kind[c], static_cast<Index>(arrays.cone_row_offsets[c + 1] - arrays.cone_row_offsets[c]), -1});
    env.row_offsets = {0};
    for (std::size_t row = first; row < end; ++row) {
      for (auto k = static_cast<std::size_t>(recording.J.ptr[row]);
           k < static_cast<std::size_t>(recording.J.ptr[row + 1]); ++k) {
        env.column.push_back(recording.J.col[k]);
        env.J.push_back(recording.J.val[k]);
      }
      env.row_offsets.push_back(static_cast<Index>(env.J.size()));
      env.target.push_back(recording.row_target[row]);
      env.R.push_back(arrays.R[row]);
      env.mu.push_back(arrays.mu[row]);
      env.lo.push_back(arrays.lo[row]);
      env.hi.push_back(arrays.hi[row]);
    }
    env.M.assign(dofs * dofs, 0.0);
    for (std::size_t i = 0; i < dofs; ++i) {
      env.v_free.push_back(recording.v_free[dof + i]);
      for (auto k = static_cast<std::size_t>(recording.M.ptr[dof + i]);
           k < static_cast<std::size_t>(recording.M.ptr[dof + i + 1]); ++k)
        env.M[i * dofs + static_cast<std::size_t>(recording.M.col[k])] += recording.M.val[k];
    }
    batch.add(env);
  }
  return batch;
}

}  // namespace stiction::test
