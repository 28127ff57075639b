#pragma once

#include "core/job/derivative_job.hpp"

namespace stiction::cpu {

/// The derivative of one environment, compiled for one instruction set.
template <class Real>
struct DerivativeKernels {
  Offset (*elements)(const DerivativeJob<Real>& job, Offset env);  ///< scratch both need, in doubles
  void (*vjp)(const VjpJob<Real>& job, Offset env, double* scratch);
  void (*jvp)(const JvpJob<Real>& job, Offset env, double* scratch);
  Offset (*chain_elements)(const JacobianVjpJob<Real>& job,
                           Offset env);  ///< scratch of those below, in numbers of Real
  void (*seed)(const JacobianVjpJob<Real>& job, Offset env, Real* scratch);
  void (*chain)(const JacobianVjpJob<Real>& job, Offset env, Real* scratch);
};

/// Kernels of both precisions.
struct DerivativeKernelSet {
  DerivativeKernels<float> f32;
  DerivativeKernels<double> f64;
};

}  // namespace stiction::cpu
