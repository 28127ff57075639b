#pragma once

#include <vector>

#include "core/schedule/plan.hpp"

namespace stiction::cuda {

/// Who works on an environment: one thread, or one block on its dense or its sparse system. The body is the same, so
/// the choice reaches speed only.
enum class Team { threads, dense_blocks, sparse_blocks };

inline constexpr int kWarp = 32;          ///< threads that run in lock-step and interleave their workspaces
inline constexpr int kThreadsWidth = 64;  ///< width of a block of Team::threads
inline constexpr int kWidestBlock = 256;

/// What a layout depends on beside the plan.
struct LayoutRules {
  Offset method_vectors;   ///< vectors of n numbers the method keeps
  Index thread_rows = 24;  ///< most rows of an environment that one thread takes
  Offset workspace_limit =
      Offset{1} << 28;  ///< numbers of workspace a launch may ask for, unless one environment needs more
};

/// Environments that one kernel launch answers.
struct LaunchSpan {
  Team team;
  int width;         ///< threads of a block
  Offset first_env;  ///< position in Layout::envs
  Offset env_count;
  Offset first_offset;  ///< position in Layout::offsets
};

/// Who solves what, where. Launches follow one another on a stream, so each has the whole workspace to itself.
struct Layout {
  std::vector<Offset> envs;     ///< environments in the order of the launches               (env_count)
  std::vector<Offset> offsets;  ///< first number of workspace: one per warp for Team::threads, else one per environment
  std::vector<LaunchSpan> launches;
  Offset workspace = 0;  ///< numbers of workspace that the largest launch needs
};

/// Threads of a block for an environment of that many rows.
int block_width(Index rows);

Layout make_layout(const PlanData& plan, const LayoutRules& rules);

}  // namespace stiction::cuda
