#include "core/algorithm/derivative/relaxed_derivative.hpp"
#include "core/algorithm/unrolled/unrolled_vjp.hpp"
#include "cpu_fallback/pack/mass_tile.hpp"
#include "cpu_fallback/tables/contact_derivative.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Job>
Offset elements_of(const Job& job, Offset env) {
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

template <class Real, class Job>
Offset jacobian_elements_of(const Job& job, Offset env) {
  return jacobian_derivative_elements<MassTile<Real>>(job, env);
}
template <class Real>
void jacobian_vjp_one(const JacobianVjpJob<Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  jacobian_vjp_env<MassTile<Real>>(team, job, env, scratch);
}
template <class Real>
void jacobian_jvp_one(const JacobianJvpJob<Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  jacobian_jvp_env<MassTile<Real>>(team, job, env, scratch);
}

template <class Real, class Job>
Offset relaxed_elements_of(const RelaxedJob<Job, Real>& job, Offset env) {
  return relaxed_elements(job.job, env);
}
template <class Real>
void relaxed_vjp_one(const RelaxedJob<VjpJob<Real>, Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  relaxed_vjp_env(team, job, env, scratch);
}
template <class Real>
void relaxed_jvp_one(const RelaxedJob<JvpJob<Real>, Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  relaxed_jvp_env(team, job, env, scratch);
}
template <class Real, class Job>
Offset relaxed_jacobian_elements_of(const RelaxedJob<Job, Real>& job, Offset env) {
  return relaxed_jacobian_elements<MassTile<Real>>(job.job, env);
}
template <class Real>
void relaxed_jacobian_vjp_one(const RelaxedJob<JacobianVjpJob<Real>, Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  relaxed_jacobian_vjp_env<MassTile<Real>>(team, job, env, scratch);
}
template <class Real>
void relaxed_jacobian_jvp_one(const RelaxedJob<JacobianJvpJob<Real>, Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  relaxed_jacobian_jvp_env<MassTile<Real>>(team, job, env, scratch);
}

template <class Real>
Offset unrolled_elements_of(const UnrolledJob<Real>& job, Offset env) {
  return unrolled_elements(job, env);
}
template <class Real>
void unrolled_one(const UnrolledJob<Real>& job, Offset env, double* scratch) {
  SerialTeam team;
  unrolled_env(team, job, env, job.cone_order + job.batch.env_cone_offsets[env], scratch);
}

template <class Real>
cpu::DerivativeKernels<Real> kernels() {
  return {{elements_of<VjpJob<Real>>, vjp_one<Real>},
          {elements_of<JvpJob<Real>>, jvp_one<Real>},
          {jacobian_elements_of<Real, JacobianVjpJob<Real>>, jacobian_vjp_one<Real>},
          {jacobian_elements_of<Real, JacobianJvpJob<Real>>, jacobian_jvp_one<Real>},
          {relaxed_elements_of<Real, VjpJob<Real>>, relaxed_vjp_one<Real>},
          {relaxed_elements_of<Real, JvpJob<Real>>, relaxed_jvp_one<Real>},
          {relaxed_jacobian_elements_of<Real, JacobianVjpJob<Real>>, relaxed_jacobian_vjp_one<Real>},
          {relaxed_jacobian_elements_of<Real, JacobianJvpJob<Real>>, relaxed_jacobian_jvp_one<Real>},
          {unrolled_elements_of<Real>, unrolled_one<Real>},
          {}};
}

}  // namespace

cpu::DerivativeKernelSet derivative_kernels() {
  return cpu::DerivativeKernelSet{kernels<float>(), kernels<double>()}.with(mode_pack_kernels());
}

}  // namespace stiction::inline STICTION_ISA
