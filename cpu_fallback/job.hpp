#pragma once

#include "core/base/full_rows.hpp"
#include "core/base/solve_job.hpp"

namespace stiction::cpu {

/// A solve on this machine.
template <class Real>
struct Job : SolveJob<Real> {
  const FullRows* full_rows = nullptr;  ///< of each environment, or null: nobody looked  (env_count)
};

/// One solver under one law, compiled for one instruction set.
template <class Real>
struct Kernels {
  int pack_width;  ///< environments in lock-step; 1: no packs, and the two pack entries are null
  /// Scratch one call needs, in numbers of Real.
  Offset (*pack_elements)(const ConeCounts& slots);
  Offset (*one_elements)(const Job<Real>& job, Offset env);
  /// Solves environments envs[0 .. count), all of dense path and with cones <= slots, in packs of `pack_width`.
  void (*solve_pack)(const Job<Real>& job, const Offset* envs, Offset count, const ConeCounts& slots, Real* scratch);
  /// Solves one environment of any path.
  void (*solve_one)(const Job<Real>& job, Offset env, Real* scratch);
};

/// Both precisions and laws of one solver.
struct KernelSet {
  Kernels<float> f32[2];   ///< by Law
  Kernels<double> f64[2];  ///< by Law
};

}  // namespace stiction::cpu
