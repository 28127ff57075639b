#pragma once

#include "core/algorithm/articulated/step.hpp"
#include "cuda/kernels/lane_memory.hpp"

namespace stiction::cuda {

/// Arguments of steps of robots beside the job, whose pointers are the device's.
template <class Real>
struct RobotsArgs : LaneRoom {
  ArticulatedJob<Real> job;
  Offset env_count;
  Index steps;            ///< that each environment makes
  const RobotTree* tree;  ///< of the model
  Offset stages_begin;    ///< of numbers of stages among those of a team
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Memory that a lane takes for its robot. Behind the numbers of a team's solves lie those of its stages.
template <class Types>
struct RobotMemory : LaneMemory<Types> {
  Offset stages_begin;
  STICTION_HD void* stages(Offset) const {
    return this->room.numbers + this->team_index * this->room.numbers_per_team + stages_begin;
  }
};

/// A lane takes an environment through all steps of a call, then the next one. Numbers lie side by side among a team's
/// lanes, lists are a lane's own.
template <class Real>
struct StepRobots {
  using Args = cuda::RobotsArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  /// Room for the largest robot of the job, without its memory.
  static void lay_out(const RobotTree& tree, Args& args) {
    constexpr auto kOffset = static_cast<Offset>(sizeof(Offset)), kDouble = static_cast<Offset>(sizeof(double));
    const ArticulatedJob<Real>& job = args.job;
    const SlotCounts largest = most_slots(job.model);
    const Index dofs = job.model.dof_count, entries = dofs * (dofs + 1) / 2;
    const RobotBytes bytes = bytes_of_robots<Types>(job, tree);
    args.stages_begin = VelocityWorkspace<Types>::doubles(largest, dofs, entries);
    static_cast<cuda::LaneRoom&>(args) = {
        nullptr, nullptr, args.stages_begin + bytes.numbers / kDouble, bytes.lists / kOffset, largest, dofs, entries};
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset first = id.index * cuda::kWarp; first < args.env_count; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        const Offset env = first + lane;
        if (env < args.env_count)
          step_robots<Types>(args.job, *args.tree, &env, 1, args.steps,
                             RobotMemory<Types>{{args, id.index, lane}, args.stages_begin});
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
