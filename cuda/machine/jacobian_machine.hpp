#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "core/machine/jacobian_machine.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/kernels/velocity_blocks_program.hpp"
#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"
#include "cuda/machine/velocity_teams.hpp"

namespace stiction::cuda {

/// Solves Jacobian batches on a device: three launches assemble, one writes, and one to seven run Newton's method in
/// velocities. Memory is allocated when it is made.
template <class Real>
class DeviceJacobianMachine final : public JacobianMachine<Real> {
 public:
  /// `by_newton`: solve_velocities() will be called. `lays_out_only`: nothing but
  /// lay_out() is called, so that no team needs scratch.
  DeviceJacobianMachine(std::shared_ptr<DeviceApi> api, const JacobianCapacity& capacity, FactorUse use, bool by_newton,
                        bool lays_out_only = false, const VelocityRules& rules = {});
  ~DeviceJacobianMachine() override;

  bool solve_velocities(const VelocityJob<Real>& job, StreamRef stream) override;
  void queue_rest(const JacobianBatchView<Real>& batch, StreamRef stream,
                  const std::function<void(StreamRef)>& rest) override;
  ContactBatchView<Real> assemble(const JacobianBatchView<Real>& batch, StreamRef stream) override;
  JacobianBatchJob<Real> lay_out(const JacobianBatchView<Real>& batch, StreamRef stream) override;
  void write(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
             StreamRef stream) override;

 private:
  void launch(const KernelRef& kernel, const LaunchShape& shape, const JacobianBatchJob<Real>& job,
              StreamHandle stream);
  void reserve_newton(const JacobianCapacity& capacity);
  void reserve_blocks(const JacobianCapacity& capacity);
  void launch_newton(const VelocityJob<Real>& job, StreamHandle stream);
  void launch_steps(const VelocityStepKernels& kernels, const VelocityJob<Real>& job, StreamHandle stream);
  void prepare_newton();
  [[nodiscard]] bool are_many(Offset envs) const;
  void finish(StreamHandle stream) noexcept;
  template <class Work>
  void queue(StreamHandle stream, const Work& work);

  std::shared_ptr<DeviceApi> api_;
  JacobianArrays<Real> arrays_{};
  Real* scratch_ = nullptr;  ///< of each team, null: in fast memory                   (teams * slot)
  Offset slot_ = 0;
  bool is_counted_ = false;     ///< solve_velocities() has counted the environments of this solve
  Offset* left_ = nullptr;      ///< not 0: it has not answered all; null: it is not called               (1)
  std::optional<Stream> rest_;  ///< for work done where it has left any
  VelocityRules rules_;
  LaunchShape small_, large_;             ///< of counting; of assembling and moving
  std::vector<LaunchShape> team_shapes_;  ///< of Newton's teams, the smallest fast memory first
  LaunchShape lane_shape_, block_shape_;  ///< of its leftovers; no teams: nothing
  bool has_large_ = false;                ///< some may have more than kMostVelocityDofs
  VelocityBlocksArgs<Real> blocks_{};
  VelocityArgs<Real> newton_{};  ///< memory of Newton's method in velocities, and how it is laid out
  ArraySet set_;
  DeviceMemory memory_;
  Event done_;  ///< the arrays are free again
};

}  // namespace stiction::cuda
