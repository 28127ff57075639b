#include "cpu_fallback/pack/lane_packs.hpp"
#include "cpu_fallback/tables/jacobian_vjp.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
void solve_all(const VelocityJob<Real>& job, const LaneEnv<Real>* envs, Offset count, cpu::VelocityScratch& scratch) {
  Offset small = 0;  // they come first
  while (small < count && envs[small].dofs <= kMostVelocityDofs) ++small;
  const auto in_double = [&](const LaneEnv<Real>& env) { return steps_in_double(job, env.env); };
  AlikeEnvs<Real> alike(job.batch, envs, small, kLanesHere<Real>, scratch, in_double);
  const auto run = [&]<class Types>(const LaneEnv<Real>* members, Index members_count) {
    solve_pack<Types>(job, members, members_count, PackMemory<Types>{scratch}, alike.cones_of(members));
  };
  for_each_pack<Real>(alike.envs(), alike.singles(), run);
  if constexpr (sizeof(Real) == sizeof(float)) {
    const LaneEnv<Real>* const doubles = alike.envs() + alike.singles();
    for_each_pack<double>(doubles, alike.doubles(), run);
    alike.keep_doubles([](const LaneEnv<Real>& env) { return is_tried_again(env) && !env.result->is_answered; });
    for_each_pack<Real>(doubles, alike.doubles(), run);
  }
  for (Offset env = small; env < count; ++env) {
    if (in_double(envs[env])) {
      using Large = LaneTypes<double, 1, LargeDofSet, Real>;
      solve_pack<Large>(job, envs + env, 1, PackMemory<Large>{scratch});
    } else {
      using Large = LaneTypes<Real, 1, LargeDofSet>;
      solve_pack<Large>(job, envs + env, 1, PackMemory<Large>{scratch});
    }
  }
}

template <class Real>
cpu::VelocityKernels<Real> kernels() {
  return {kLanesHere<Real>, solve_all<Real>, jacobian_vjp_all<Real>};
}

}  // namespace

cpu::VelocityKernelSet velocity_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
