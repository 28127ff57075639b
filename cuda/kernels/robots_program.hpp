#pragma once

#include "core/algorithm/articulated/step.hpp"
#include "cuda/api/robot_kernels.hpp"
#include "cuda/kernels/lane_memory.hpp"

namespace stiction::cuda {

/// Arguments of steps of robots beside the job, whose pointers are the device's.
template <class Real>
struct RobotsArgs : LaneRoom {
  ArticulatedJob<Real> job;
  Offset env_count;
  Index steps;            ///< that each environment makes
  const RobotTree* tree;  ///< of the model
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// A lane takes an environment through all steps of a call, then the next one. Numbers of solves lie side by side
/// among a team's lanes, all else is a lane's own (RobotLists, RobotWorkspace).
template <class Real>
struct StepRobots {
  using Args = cuda::RobotsArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  /// Room for the largest robot, without its memory.
  static cuda::LaneRoom lay_out(const ArticulatedJob<Real>& job, const RobotTree& tree) {
    constexpr auto kOffset = static_cast<Offset>(sizeof(Offset));
    const SlotCounts largest = most_slots(job.model);
    const Index dofs = job.model.dof_count, entries = dofs * (dofs + 1) / 2;
    return {nullptr,
            nullptr,
            VelocityWorkspace<Types>::doubles(largest, dofs, entries),
            bytes_of_robots<Types>(job, tree) / kOffset,
            largest,
            dofs,
            entries};
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset first = id.index * cuda::kWarp; first < args.env_count; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        const Offset env = first + lane;
        if (env < args.env_count)
          step_robots<Types>(args.job, *args.tree, &env, 1, args.steps, LaneMemory<Types>{args, id.index, lane});
      });
  }
};

}  // namespace stiction::inline STICTION_ISA

namespace stiction::cuda {

template <class Make>
RobotKernels robot_kernels() {
  return {{Make::template kernel<StepRobots<float>>("step_robots"),
           Make::template kernel<StepRobots<double>>("step_robots")}};
}

}  // namespace stiction::cuda
