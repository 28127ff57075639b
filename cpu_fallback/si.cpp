#include "core/body/bodies/si_body.hpp"

#include "cpu_fallback/bodies_job.hpp"
#include "cpu_fallback/team_block.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, Law kLaw, Block B>
void solve_on(B& block, const BodyJob<Real>& job, Offset env, Real* scratch, double* exact) {
  const BodyEnv<Real> view = slice_bodies(job, env);
  const SiParams params = si_params(job.stepping, job.options);
  const BodySystem<Real, kLaw> system(view.kept, view.bodies, params, scratch, exact);
  solve_bodies(block, view, system, params);
}

template <class Real, Law kLaw>
void solve_alone(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact) {
  SerialBlock block;
  solve_on<Real, kLaw>(block, job, env, scratch, exact);
}

template <class Real, Law kLaw>
void solve_together(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact, cpu::ThreadTeam& team,
                    Index rank) {
  TeamBlock block(team, rank);
  solve_on<Real, kLaw>(block, job, env, scratch, exact);
}

template <class Real, Law kLaw>
cpu::BodyKernels<Real> kernels() {
  using System = BodySystem<Real, kLaw>;
  return {System::elements, System::exact_elements, System::swept_elements, solve_alone<Real, kLaw>,
          solve_together<Real, kLaw>};
}

}  // namespace

cpu::BodyKernelSet si_kernels() {
  return {{kernels<float, Law::convex>(), kernels<float, Law::coulomb>()},
          {kernels<double, Law::convex>(), kernels<double, Law::coulomb>()}};
}

}  // namespace stiction::inline STICTION_ISA
