#include "cpu_fallback/tables/velocity_adjoint.hpp"

#include "core/algorithm/derivative/adjoint_pack.hpp"
#include "cpu_fallback/pack/lane_packs.hpp"

namespace stiction::inline STICTION_ISA {

template <class Real>
void pull_all(const JacobianVjpJob<Real>& job, const LaneEnv<Real>* envs, AdjointResult* results, Offset count,
              cpu::VelocityScratch& scratch) {
  Offset small = 0;  // they come first
  while (small < count && envs[small].dofs <= kMostVelocityDofs) ++small;
  const AlikeEnvs<Real> alike(job.assembly.batch, envs, small, kLanesHere<Real>, scratch,
                              [](const auto&) { return false; });
  auto* const own = scratch.results.reserve<AdjointResult>(small);
  for (Offset i = 0; i < small; ++i) own[i] = results[alike.from(i)];
  for_each_pack<Real>(alike.envs(), small, [&]<class Types>(const LaneEnv<Real>* members, Index members_count) {
    pull_pack<Types>(job, members, own + (members - alike.envs()), members_count, PackMemory<Types>{scratch},
                     alike.cones_of(members));
  });
  for (Offset i = 0; i < small; ++i) results[alike.from(i)] = own[i];
  using Large = LaneTypes<Real, 1, LargeDofSet>;
  for (Offset env = small; env < count; ++env)
    pull_pack<Large>(job, envs + env, results + env, 1, PackMemory<Large>{scratch});
}

template void pull_all(const JacobianVjpJob<float>&, const LaneEnv<float>*, AdjointResult*, Offset,
                       cpu::VelocityScratch&);
template void pull_all(const JacobianVjpJob<double>&, const LaneEnv<double>*, AdjointResult*, Offset,
                       cpu::VelocityScratch&);

}  // namespace stiction::inline STICTION_ISA
