#include "core/algorithm/derivative/jacobian_vjp.hpp"
#include "core/algorithm/derivative/jvp.hpp"
#include "cpu_fallback/kernels/derivative_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real>
Offset elements_of(const DerivativeJob<Real>& job, Offset env) {
  return derivative_elements(job, env);
}
template <class Real>
void vjp_one(const VjpJob<Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  vjp_env(team, job, env, scratch);
}
template <class Real>
void jvp_one(const JvpJob<Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  jvp_env(team, job, env, scratch);
}

template <class Real>
Offset chain_elements_of(const JacobianVjpJob<Real>& job, Offset env) {
  return chain_elements(job, env);
}
template <class Real>
void seed_one(const JacobianVjpJob<Real>& job, Offset env, Real* scratch) {
  SerialTeam team;
  seed_env(team, job, env, scratch);
}
template <class Real>
void chain_one(const JacobianVjpJob<Real>& job, Offset env, Real* scratch) {
  SerialTeam team;
  chain_env(team, job, env, scratch);
}

template <class Real>
cpu::DerivativeKernels<Real> kernels() {
  return {elements_of<Real>, vjp_one<Real>, jvp_one<Real>, chain_elements_of<Real>, seed_one<Real>, chain_one<Real>};
}

}  // namespace

cpu::DerivativeKernelSet derivative_kernels() {
  return {kernels<float>(), kernels<double>()};
}

}  // namespace stiction::inline STICTION_ISA
