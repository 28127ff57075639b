#pragma once

#include "core/job/relaxed_job.hpp"
#include "core/job/unrolled_job.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::cpu {

/// One kind of derivative, of one environment.
template <class Job>
struct DerivativeKernel {
  Offset (*elements)(const Job& job, Offset env);  ///< scratch, in doubles
  void (*run)(const Job& job, Offset env, double* scratch);
};

/// Environments of contacts that are differentiated side by side, with the bits of one by one.
template <class Job>
struct ModePackKernel {
  Index width = 1;  ///< environments of a pack; 1: there are no packs
  bool (*takes)(const Job& job, Offset env) = nullptr;
  /// Takes environments that follow one another in `envs`, and marks in `answered` those that it has answered.
  void (*run)(const Job& job, const Offset* envs, Offset count, std::uint8_t* answered, Scratch& scratch) = nullptr;
};

/// Packs of both directions. By J and M, the reverse one is in VelocityKernels.
template <class Real>
struct ModePackKernels {
  ModePackKernel<VjpJob<Real>> vjp;
  ModePackKernel<JvpJob<Real>> jvp;
  /// Pushes environments of J and M forward that lanes take.
  void (*jacobian_jvp)(const JacobianJvpJob<Real>& job, const LaneEnv<Real>* envs, JacobianPackResult* results,
                       Offset count, VelocityScratch& scratch) = nullptr;
};

/// Kernels of both precisions.
struct ModePackKernelSet {
  ModePackKernels<float> f32;
  ModePackKernels<double> f64;
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
  ModePackKernels<Real> packs;
};

/// Kernels of both precisions.
struct DerivativeKernelSet {
  DerivativeKernels<float> f32;
  DerivativeKernels<double> f64;

  /// These, with packs of another instruction set.
  [[nodiscard]] DerivativeKernelSet with(const ModePackKernelSet& packs) const {
    DerivativeKernelSet set = *this;
    set.f32.packs = packs.f32;
    set.f64.packs = packs.f64;
    return set;
  }
};

}  // namespace stiction::cpu
