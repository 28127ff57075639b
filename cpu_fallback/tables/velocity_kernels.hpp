#pragma once

#include "core/job/derivative_job.hpp"
#include "core/job/velocity_job.hpp"
#include "cpu_fallback/tables/scratch.hpp"

namespace stiction::cpu {

/// Memory of one worker: facts about a pack, its numbers, and the order that environments are taken in.
struct VelocityScratch {
  GrowBuffer lists;
  Scratch numbers;
  GrowBuffer items, begins, keys, envs, listed, results;
};

/// Newton's method in velocities and its derivative, compiled for one instruction set.
template <class Real>
struct VelocityKernels {
  Index width;  ///< environments of a pack; 1: they are solved one by one
  /// Solves environments, or parts of some, of sizes that the method takes. Packs are made of those that are alike.
  void (*solve)(const VelocityJob<Real>& job, const LaneEnv<Real>* envs, Offset count, VelocityScratch& scratch);
  /// Pulls environments back, or parts of some, that lanes take. `results` come with the scales of parts.
  void (*vjp)(const JacobianVjpJob<Real>& job, const LaneEnv<Real>* envs, JacobianPackResult* results, Offset count,
              VelocityScratch& scratch);
};

/// Kernels of both precisions.
struct VelocityKernelSet {
  VelocityKernels<float> f32;
  VelocityKernels<double> f64;
};

}  // namespace stiction::cpu
