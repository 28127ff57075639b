#include "core/algorithm/articulated/step.hpp"
#include "cpu_fallback/pack/lane_packs.hpp"
#include "cpu_fallback/tables/articulated_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

/// A pack of one where wider vectors have kernels of packs.
template <class Real, int kLanes>
struct LanesOf {
  using Type = Pack<Real, kLanes>;
};
template <class Real>
struct LanesOf<Real, 1> {
  using Type = Real;
};

/// Memory of a pack of robots.
template <class Types>
struct RobotMemory : PackMemory<Types> {
  cpu::GrowBuffer& numbers_of_stages;
  static constexpr Index lane = 0;
  void* stages(Offset bytes) const { return numbers_of_stages.reserve<char>(bytes); }
};

template <class Real>
void step_pack(const ArticulatedJob<Real>& job, const Offset* envs, Index count, Index steps,
               cpu::ArticulatedScratch& scratch) {
  using Types = LaneTypes<typename LanesOf<Real, kLanesHere<Real>>::Type>;
  RobotTree& tree = *scratch.tree.reserve<RobotTree>(1);
  build_robot_tree(job.model, tree);
  step_robots<Types>(job, tree, envs, count, steps, RobotMemory<Types>{{scratch.pack}, scratch.stages});
}

template <class Real>
cpu::ArticulatedKernels<Real> kernels() {
  return {kLanesHere<Real>, step_pack<Real>};
}

}  // namespace

cpu::ArticulatedKernelSet articulated_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
