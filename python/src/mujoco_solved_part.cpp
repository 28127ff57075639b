#include "python/src/mujoco_solved_part.hpp"

#include <algorithm>

namespace stiction::python {

namespace {

/// Numbers of some environments.
template <class Number>
const Number* chosen(const Number* all, const std::vector<std::size_t>& envs, std::vector<Number>& memory) {
  if (all == nullptr) return nullptr;
  memory.clear();
  for (const std::size_t env : envs) memory.push_back(all[env]);
  return memory.data();
}

/// Offsets of some environments, between which nothing lies, and the end.
const Offset* chosen_offsets(const std::vector<Offset>& all, const std::vector<std::size_t>& envs,
                             std::vector<Offset>& memory) {
  chosen(all.data(), envs, memory);
  memory.push_back(all.back());
  return memory.data();
}

}  // namespace

JacobianBatchView<double> SolvedPart::take(const MujocoSystem& system, const double* tolerance,
                                           const Index* max_iterations) {
  envs_.clear();
  for (std::size_t env = 0; env + 1 < system.env_dof_offsets.size(); ++env)
    if (system.env_dof_offsets[env] < system.env_dof_offsets[env + 1]) envs_.push_back(env);
  status_.resize(envs_.size());
  JacobianBatchView<double> view = system.view();
  view.env_count = static_cast<Offset>(envs_.size());
  view.env_row_offsets = chosen_offsets(system.env_row_offsets, envs_, rows_);
  view.env_cone_offsets = chosen_offsets(system.env_cone_offsets, envs_, cones_);
  view.env_dof_offsets = chosen_offsets(system.env_dof_offsets, envs_, dofs_);
  view.env_mass_offsets = chosen_offsets(system.env_mass_offsets, envs_, masses_);
  view.env_tolerance = chosen(tolerance, envs_, tolerance_);
  view.env_max_iterations = chosen(max_iterations, envs_, max_iterations_);
  return view;
}

void SolvedPart::hand_out(MujocoSystem& system, const EnvStatus& otherwise) const {
  std::fill(system.status.begin(), system.status.end(), otherwise);
  for (std::size_t i = 0; i < envs_.size(); ++i) system.status[envs_[i]] = status_[i];
}

}  // namespace stiction::python
