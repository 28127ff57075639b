#include "cpu_fallback/tables/velocity_blocks.hpp"

#include "core/algorithm/velocity/blocks/block_newton.hpp"

namespace stiction::inline STICTION_ISA {

template <class Real>
VelocityResult solve_one_in_blocks(const VelocityJob<Real>& job, const LaneEnv<Real>& env,
                                   cpu::VelocityScratch& scratch) {
  const BlockExtent extent = extent_of_blocks(env);
  SerialTeam team;
  return solve_in_blocks(team, job, env, scratch.lists.template reserve<Index>(BlockLists::integers(extent)),
                         scratch.numbers.template reserve<double>(BlockWorkspace::doubles(extent, team.size())));
}

template VelocityResult solve_one_in_blocks(const VelocityJob<float>&, const LaneEnv<float>&, cpu::VelocityScratch&);
template VelocityResult solve_one_in_blocks(const VelocityJob<double>&, const LaneEnv<double>&, cpu::VelocityScratch&);

}  // namespace stiction::inline STICTION_ISA
