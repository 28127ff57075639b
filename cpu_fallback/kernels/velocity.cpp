#include "cpu_fallback/kernels/velocity_adjoint.hpp"
#include "cpu_fallback/kernels/velocity_kernels.hpp"
#include "cpu_fallback/pack/lane_packs.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
void solve_all(const VelocityJob<Real>& job, const LaneEnv<Real>* envs, Offset count, cpu::VelocityScratch& scratch) {
  Offset small = 0;  // they come first
  while (small < count && envs[small].dofs <= kMostVelocityDofs) ++small;
  for_each_pack(envs, small, [&]<class Types>(const LaneEnv<Real>* members, Index members_count) {
    solve_pack<Types>(job, members, members_count, PackMemory<Types>{scratch});
  });
  using Large = LaneTypes<Real, 1, LargeDofSet>;
  for (Offset env = small; env < count; ++env) solve_pack<Large>(job, envs + env, 1, PackMemory<Large>{scratch});
}

template <class Real>
cpu::VelocityKernels<Real> kernels() {
  return {kLanesHere<Real>, solve_all<Real>, pull_all<Real>};
}

}  // namespace

cpu::VelocityKernelSet velocity_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
