#pragma once

#include "core/job/relaxed_job.hpp"
#include "core/job/unrolled_job.hpp"

namespace stiction::cpu {

/// One kind of derivative, of one environment.
template <class Job>
struct DerivativeKernel {
  Offset (*elements)(const Job& job, Offset env);  ///< scratch, in doubles
  void (*run)(const Job& job, Offset env, double* scratch);
};

/// The derivatives of one environment, compiled for one instruction set.
template <class Real>
struct DerivativeKernels {
  DerivativeKernel<VjpJob<Real>> vjp;
  DerivativeKernel<JvpJob<Real>> jvp;
  DerivativeKernel<JacobianVjpJob<Real>> jacobian_vjp;
  DerivativeKernel<JacobianJvpJob<Real>> jacobian_jvp;
  DerivativeKernel<RelaxedJob<VjpJob<Real>, Real>> relaxed_vjp;
  DerivativeKernel<RelaxedJob<JvpJob<Real>, Real>> relaxed_jvp;
  DerivativeKernel<RelaxedJob<JacobianVjpJob<Real>, Real>> relaxed_jacobian_vjp;
  DerivativeKernel<RelaxedJob<JacobianJvpJob<Real>, Real>> relaxed_jacobian_jvp;
  DerivativeKernel<UnrolledJob<Real>> unrolled_vjp;
};

/// Kernels of both precisions.
struct DerivativeKernelSet {
  DerivativeKernels<float> f32;
  DerivativeKernels<double> f64;
};

}  // namespace stiction::cpu
