// The solve of a chunk of simulations, and its start.

#include "python/src/mujoco.hpp"

namespace stiction::python {

void MujocoChunk::make_room() {
  const auto envs = static_cast<Offset>(data_.size());
  const auto cones = static_cast<Offset>(system_.cone_kind.size());
  const auto rows = static_cast<Offset>(system_.R.size());
  if (store_ && cones <= store_->capacity().cones && rows <= store_->capacity().rows) return;
  WarmStartOptions options;
  options.beta = warm_start_;
  options.scaling = StepScaling::none;  // reactions are forces here
  options.threads = options_.threads;
  store_ = std::make_unique<WarmStartStore<double>>(Device::cpu(), WarmStartCapacity{envs, 2 * cones + 1, 2 * rows + 1},
                                                    options);
  // Reactions of the smaller one, without those reset since: room must not reach a bit.
  if (previous_.env_row_offsets.size() != data_.size() + 1) return;
  store_->store(previous_.layout(), previous_.cone_id.data(),
                {previous_.lambda.data(), nullptr, previous_.status.data()}, layout_.timestep);
  store_->reset_where(was_reset_.data());
}

void MujocoChunk::solve(JacobianSolver<double>& solver, const double* tolerance, const Index* max_iterations) {
  const bool warm = warm_start_ > 0.0, by_accelerations = warm && starts_from_accelerations();
  const bool by_reactions = warm && !by_accelerations;
  if (by_reactions) {
    make_room();
    guess_.reserve(1);
    guess_.resize(system_.R.size());
    store_->load(system_.layout(), system_.cone_id.data(), layout_.timestep, guess_.data());
  }
  const JacobianStart<double> start{by_reactions ? guess_.data() : nullptr,
                                    by_accelerations ? system_.start.data() : nullptr};
  const JacobianBatchView<double> part = solved_.take(system_, tolerance, max_iterations);
  if (part.env_count > 0)
    solver.solve(part, {system_.lambda.data(), nullptr, system_.velocity.data(), solved_.status()}, start);
  // Solver named for an environment without rows; auto begins with this one.
  const SolverKind named = options_.solver == SolverKind::automatic ? SolverKind::velocity_newton : options_.solver;
  solved_.hand_out(system_, EnvStatus{0.0, 0.0, 0, 0, EnvCode::solved, named, {0, 0}, 0});
  for (std::size_t env = 0; env < data_.size(); ++env)
    if (active_[env] != 0) starts_over_[env] = 0;
  if (!by_reactions) return;
  store_->store(system_.layout(), system_.cone_id.data(), {system_.lambda.data(), nullptr, system_.status.data()},
                layout_.timestep);
  was_reset_.assign(data_.size(), 0);
}

}  // namespace stiction::python
