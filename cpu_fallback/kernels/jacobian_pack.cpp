#include "cpu_fallback/tables/jacobian_vjp.hpp"

#include "core/algorithm/derivative/jacobian_pack.hpp"
#include "core/algorithm/derivative/jacobian_pack_limits.hpp"
#include "cpu_fallback/pack/lane_packs.hpp"
#include "cpu_fallback/tables/jacobian_jvp.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, class Job>
void derive_all(const Job& job, const LaneEnv<Real>* envs, JacobianPackResult* results, Offset count,
                cpu::VelocityScratch& scratch) {
  Offset small = 0;  // they come first
  while (small < count && envs[small].dofs <= kMostVelocityDofs) ++small;
  const AlikeEnvs<Real> alike(job.assembly.batch, envs, small, kLanesHere<Real>, scratch,
                              [](const auto&) { return false; });
  auto* const own = scratch.results.reserve<JacobianPackResult>(small);
  for (Offset i = 0; i < small; ++i) own[i] = results[alike.from(i)];
  for_each_pack<Real>(alike.envs(), small, [&]<class Types>(const LaneEnv<Real>* members, Index members_count) {
    jacobian_pack<Types>(job, members, own + (members - alike.envs()), members_count, PackMemory<Types>{scratch},
                         alike.cones_of(members));
  });
  for (Offset i = 0; i < small; ++i) results[alike.from(i)] = own[i];
  using Large = LaneTypes<Real, 1, LargeDofSet>;
  for (Offset env = small; env < count; ++env)
    jacobian_pack<Large>(job, envs + env, results + env, 1, PackMemory<Large>{scratch});
}

}  // namespace

template <class Real>
void jacobian_vjp_all(const JacobianVjpJob<Real>& job, const LaneEnv<Real>* envs, JacobianPackResult* results,
                      Offset count, cpu::VelocityScratch& scratch) {
  derive_all(job, envs, results, count, scratch);
}
template <class Real>
void jacobian_jvp_all(const JacobianJvpJob<Real>& job, const LaneEnv<Real>* envs, JacobianPackResult* results,
                      Offset count, cpu::VelocityScratch& scratch) {
  derive_all(job, envs, results, count, scratch);
}

template void jacobian_vjp_all(const JacobianVjpJob<float>&, const LaneEnv<float>*, JacobianPackResult*, Offset,
                               cpu::VelocityScratch&);
template void jacobian_vjp_all(const JacobianVjpJob<double>&, const LaneEnv<double>*, JacobianPackResult*, Offset,
                               cpu::VelocityScratch&);
template void jacobian_jvp_all(const JacobianJvpJob<float>&, const LaneEnv<float>*, JacobianPackResult*, Offset,
                               cpu::VelocityScratch&);
template void jacobian_jvp_all(const JacobianJvpJob<double>&, const LaneEnv<double>*, JacobianPackResult*, Offset,
                               cpu::VelocityScratch&);

}  // namespace stiction::inline STICTION_ISA
