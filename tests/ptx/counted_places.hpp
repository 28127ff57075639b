#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "cuda/kernels/derivative_lanes_program.hpp"
#include "cuda/kernels/robots_program.hpp"
#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"
#include "cuda/kernels/work_queue.hpp"
#include "tests/ptx/replay.hpp"

/// Places of the arrays that traced kernels read and write.
namespace stiction::test {

using ptx::Memory;
using ptx::TracedLaunch;

template <class Args>
Args arguments_of(const TracedLaunch& launch) {
  Args args;
  EXPECT_EQ(launch.arguments.size(), sizeof(args));
  std::memcpy(&args, launch.arguments.data(), sizeof(args));
  return args;
}

/// Arrays that a launch writes its answers to.
template <class Real>
std::vector<ptx::Place> answer_places(const VelocityJob<Real>& job) {
  return {place_of(job.to.lambda, job.batch.row_count, Memory::output),
          place_of(job.to.w, job.batch.row_count, Memory::output),
          place_of(job.to.velocity, job.batch.dof_count, Memory::output),
          place_of(job.to.status, job.batch.env_count, Memory::output)};
}
template <class Real>
std::vector<ptx::Place> velocity_lane_places(const TracedLaunch& launch) {
  const auto args = arguments_of<cuda::VelocityArgs<Real>>(launch);
  const Offset teams = (args.job.batch.env_count + cuda::kWarp - 1) / cuda::kWarp;
  auto places = answer_places(args.job);
  places.push_back(place_of(args.numbers, teams * args.numbers_per_team, Memory::scratch));
  places.push_back(place_of(args.lists, teams * cuda::kWarp * args.lists_per_lane, Memory::lists));
  return places;
}
template <class Real>
std::vector<ptx::Place> velocity_team_places(const TracedLaunch& launch) {
  return answer_places(arguments_of<cuda::VelocityTeamArgs<Real>>(launch).job);
}
/// Numbers of the reverse pass that the next launch reads are output, too.
template <class Real>
std::vector<ptx::Place> derivative_lane_places(const TracedLaunch& launch) {
  const auto args = arguments_of<cuda::JacobianLanesArgs<Real>>(launch);
  const JacobianBatchView<Real>& batch = args.job.assembly.batch;
  const Offset teams = (batch.env_count + cuda::kWarp - 1) / cuda::kWarp, count = args.job.contact.count;
  const auto& to = args.job.gradients;
  std::vector<ptx::Place> places = {place_of(to.v_free, count * batch.dof_count, Memory::output),
                                    place_of(args.job.seed, count * batch.row_count, Memory::output),
                                    place_of(args.job.nu, count * batch.row_count, Memory::output),
                                    place_of(args.job.lanes.adjoint, count * batch.dof_count, Memory::output),
                                    place_of(args.job.lanes.moved, batch.dof_count, Memory::output),
                                    place_of(args.numbers, teams * args.numbers_per_team, Memory::scratch),
                                    place_of(args.lists, teams * cuda::kWarp * args.lists_per_lane, Memory::lists)};
  for (const Real* rows : {to.target, to.R, to.mu, to.lo, to.hi})
    places.push_back(place_of(rows, count * batch.row_count, Memory::output));
  return places;
}
template <class Real>
std::vector<ptx::Place> queue_places(const TracedLaunch& launch) {
  const auto args = arguments_of<cuda::QueuedJob<Real>>(launch);
  const bool has_lane_each = args.queue.size_class >= SizeClass::thread_large;
  const auto slots = static_cast<Offset>(launch.lanes.size()) / (has_lane_each ? 1 : cuda::kWarp);
  const Offset room = args.queue.workspace == nullptr ? 0 : slots * args.queue.slot_elements;
  return {place_of(args.job.lambda, args.job.batch.row_count, Memory::output),
          place_of(args.job.w, args.job.batch.row_count, Memory::output),
          place_of(args.job.status, args.job.batch.env_count, Memory::output),
          place_of(args.queue.workspace, room, Memory::scratch)};
}

template <class Real>
std::vector<ptx::Place> robot_places(const TracedLaunch& launch) {
  const auto args = arguments_of<cuda::RobotsArgs<Real>>(launch);
  const Offset teams = (args.env_count + cuda::kWarp - 1) / cuda::kWarp;
  std::vector<ptx::Place> places{place_of(args.numbers, teams * args.numbers_per_team, Memory::scratch),
                                 place_of(args.lists, teams * cuda::kWarp * args.lists_per_lane, Memory::lists)};
  const auto add = [&](Index width, auto* array) {
    places.push_back(place_of(array, args.env_count * width, Memory::output));
  };
  for_each_state_array(args.job.model, add, args.job);
  return places;
}

/// Kernels by a part of their names, and where the arrays of their launches lie.
struct Counted {
  const char* kernel;
  std::vector<ptx::Place> (*places)(const TracedLaunch&);
};
inline constexpr Counted kCounted[] = {{"DerivativeLanesProgram<float", derivative_lane_places<float>},
                                       {"DerivativeLanesProgram<double", derivative_lane_places<double>},
                                       {"StepRobots<float", robot_places<float>},
                                       {"StepRobots<double", robot_places<double>},
                                       {"SolveVelocities<float", velocity_lane_places<float>},
                                       {"SolveVelocities<double", velocity_lane_places<double>},
                                       {"SolveVelocityTeams<float", velocity_team_places<float>},
                                       {"SolveVelocityTeams<double", velocity_team_places<double>},
                                       {"(stiction::Law)0, float>", queue_places<float>},
                                       {"(stiction::EnvPath)1, float>", queue_places<float>},
                                       {"(stiction::Law)0, double>", queue_places<double>}};

}  // namespace stiction::test
