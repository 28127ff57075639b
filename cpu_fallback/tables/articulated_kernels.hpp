#pragma once

#include "core/job/articulated_job.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::cpu {

/// Memory of one worker that steps robots.
struct ArticulatedScratch {
  GrowBuffer tree, stages;
  VelocityScratch pack;
};

/// Steps of robots in lanes, compiled for one instruction set.
template <class Real>
struct ArticulatedKernels {
  Index width;  ///< environments of a pack
  /// Takes some environments a number of steps further, at most `width` of them.
  void (*step)(const ArticulatedJob<Real>& job, const Offset* envs, Index count, Index steps,
               ArticulatedScratch& scratch);
};

/// Kernels of both precisions.
struct ArticulatedKernelSet {
  ArticulatedKernels<float> f32;
  ArticulatedKernels<double> f64;
};

}  // namespace stiction::cpu
