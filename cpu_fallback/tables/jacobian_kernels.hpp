#pragma once

#include "core/job/jacobian_job.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::cpu {

/// The work on one environment of a Jacobian batch, compiled for one instruction set.
template <class Real>
struct JacobianKernels {
  Offset (*elements)(const JacobianJob<Real>& job, Offset env);  ///< scratch both need, in numbers of Real
  void (*assemble)(const JacobianJob<Real>& job, Offset env, Real* scratch);
  void (*velocity)(const JacobianJob<Real>& job, Offset env, Real* scratch);
  /// Newton's method in velocities on an environment of a size that it takes in blocks.
  VelocityResult (*solve_in_blocks)(const VelocityJob<Real>& job, const LaneEnv<Real>& env, VelocityScratch& scratch);
};

/// Kernels of both precisions.
struct JacobianKernelSet {
  JacobianKernels<float> f32;
  JacobianKernels<double> f64;
};

}  // namespace stiction::cpu
