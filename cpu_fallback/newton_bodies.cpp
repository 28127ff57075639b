#include "core/body/bodies/newton/newton_bodies.hpp"

#include "cpu_fallback/bodies_job.hpp"
#include "cpu_fallback/team_block.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, Law kLaw, Block B>
void solve_on(B& block, const BodyJob<Real>& job, Offset env, Real* scratch, double* exact) {
  using System = BodySystem<Real, kLaw>;
  const BodyEnv<Real> view = slice_bodies(job, env);
  const SiParams params = si_params(job.stepping, job.options);
  const System system(view.kept, view.bodies, params, scratch, exact);
  const SpaceRoom room(kLaw, view.kept, view.bodies, view.newton_stream, exact + System::exact_elements(view.bodies));
  solve_bodies_newton(block, view, system, params, job.options.space, room);
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

template <class Real>
Offset doubles(const BodyJob<Real>& job, Offset env) {
  const BodyEnv<Real> view = slice_bodies(job, env);
  return newton_doubles(view.kept, view.newton_stream, job.options.space);
}

template <class Real, Law kLaw>
cpu::NewtonBodyKernels<Real> kernels() {
  return {doubles<Real>, solve_alone<Real, kLaw>, solve_together<Real, kLaw>};
}

}  // namespace

cpu::NewtonBodyKernelSet newton_body_kernels() {
  return {{kernels<float, Law::convex>(), kernels<float, Law::coulomb>()},
          {kernels<double, Law::convex>(), kernels<double, Law::coulomb>()}};
}

}  // namespace stiction::inline STICTION_ISA
