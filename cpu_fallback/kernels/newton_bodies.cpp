#include "core/algorithm/rigid/newton/newton_bodies.hpp"

#include "cpu_fallback/tables/solve_bodies.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
Offset doubles(const BodyJob<Real>& job, Offset env) {
  const BodyEnv<Real> view = slice_bodies(job, env);
  return newton_doubles(view.kept, view.newton_stream, job.options.space);
}

template <class Real, Law kLaw>
cpu::NewtonBodyKernels<Real> kernels() {
  using Method = BodyNewton<kLaw, Real>;
  return {doubles<Real>, solve_alone<Method, Real>, solve_together<Method, Real>};
}

}  // namespace

cpu::NewtonBodyKernelSet newton_body_kernels() {
  return {{kernels<float, Law::convex>(), kernels<float, Law::coulomb>()},
          {kernels<double, Law::convex>(), kernels<double, Law::coulomb>()}};
}

}  // namespace stiction::inline STICTION_ISA
