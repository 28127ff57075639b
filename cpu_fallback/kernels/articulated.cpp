#include "core/algorithm/articulated/step.hpp"
#include "cpu_fallback/pack/pack_width.hpp"
#include "cpu_fallback/tables/articulated_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

/// Memory of a pack.
struct RobotMemory {
  cpu::ArticulatedScratch& scratch;

  template <class Slot>
  Slot* slots(Index count) {
    return scratch.slots.reserve<Slot>(count);
  }
  template <class Small, class Real>
  Small* columns(const ArticulatedModelView<Real>& model) {
    Index room = 0;
    for (Index c = 0; c < model.classes; ++c) room += 2 * model.row_class[c].column_count;
    return scratch.columns.reserve<Small>(room);
  }
  Index* groups(Index classes) { return scratch.groups.reserve<Index>(classes); }
  double* numbers(Offset count) { return scratch.numbers.reserve<double>(count); }
};

/// A pack of one where wider vectors have kernels of packs.
template <class Real>
inline constexpr int kRobotLanes = kSinglesAlone ? 1 : kPackWidth<Real>;
template <class Real, int kLanes>
struct LanesOf {
  using Type = Pack<Real, kLanes>;
};
template <class Real>
struct LanesOf<Real, 1> {
  using Type = Real;
};

template <class Real>
void step_pack(const ArticulatedJob<Real>& job, const Offset* envs, Index count, Index steps,
               cpu::ArticulatedScratch& scratch) {
  using Lanes = typename LanesOf<Real, kRobotLanes<Real>>::Type;
  RobotTree& tree = *scratch.tree.reserve<RobotTree>(1);
  build_robot_tree(job.model, tree);
  RobotWorkspace<Lanes> work;
  const Offset bytes = work.place(job, tree.entries, nullptr);
  work.place(job, tree.entries, scratch.work.reserve<char>(bytes));
  RobotMemory memory{scratch};
  RobotStep<Lanes, RobotMemory> step(job, tree, work, memory);
  step.take(envs, count);
  for (Index k = 0; k < steps; ++k) step.run(k + 1 == steps);
}

template <class Real>
cpu::ArticulatedKernels<Real> kernels() {
  return {kRobotLanes<Real>, step_pack<Real>};
}

}  // namespace

cpu::ArticulatedKernelSet articulated_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
