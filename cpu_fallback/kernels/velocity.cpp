#include "core/algorithm/velocity/solve_pack.hpp"
#include "cpu_fallback/kernels/velocity_kernels.hpp"
#include "cpu_fallback/pack/pack_width.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

/// Where a pack's memory comes from.
template <class Types>
struct PackMemory {
  cpu::VelocityScratch& scratch;
  void* lists(Offset bytes) const { return scratch.lists.template reserve<char>(bytes); }
  VelocityWorkspace<Types> numbers(const SlotCounts& counts, Index dofs, Index tree_entries) const {
    using Workspace = VelocityWorkspace<Types>;
    const Offset doubles = Workspace::doubles(counts, dofs, tree_entries);
    return Workspace(scratch.numbers.template reserve<double>(doubles), counts, dofs, tree_entries);
  }
};

template <class Real>
constexpr int kWidthHere = kSinglesAlone ? 1 : kPackWidth<Real>;

/// So few environments take longer in a pack than one by one.
constexpr Offset kFewest = 3;

template <class Real>
void solve_all(const VelocityJob<Real>& job, const LaneEnv<Real>* envs, Offset count, cpu::VelocityScratch& scratch) {
  constexpr int kWidth = kWidthHere<Real>;
  using Single = LaneTypes<Real>;
  using Large = LaneTypes<Real, 1, LargeDofSet>;
  Offset small = 0;  // they come first
  while (small < count && envs[small].dofs <= kMostVelocityDofs) ++small;
  Offset done = 0;
  if constexpr (kWidth > 1) {
    using Packed = LaneTypes<Pack<Real, kWidth>>;
    for (; small - done >= kFewest; done += kWidth) {
      const auto members = static_cast<Index>(small - done < kWidth ? small - done : kWidth);
      solve_pack<Packed>(job, envs + done, members, PackMemory<Packed>{scratch});
    }
  }
  for (; done < small; ++done) solve_pack<Single>(job, envs + done, 1, PackMemory<Single>{scratch});
  for (done = small; done < count; ++done) solve_pack<Large>(job, envs + done, 1, PackMemory<Large>{scratch});
}

}  // namespace

cpu::VelocityKernelSet velocity_kernels() {
  return {{kWidthHere<float>, solve_all<float>}, {kWidthHere<double>, solve_all<double>}};
}

}  // namespace stiction::inline STICTION_ISA
