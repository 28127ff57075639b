#pragma once

#include "core/base/dense_rows.hpp"
#include "core/job/solve_job.hpp"
#include "cpu_fallback/tables/kernel_tables.hpp"

namespace stiction::cpu {

/// A solve on this machine.
template <class Real>
struct Job : SolveJob<Real> {
  const FullRows* full_rows = nullptr;  ///< of each environment, or null: not looked at  (env_count)
};

/// One solver on one environment at a time, of any path and either law.
template <class Real>
struct SingleKernels {
  Offset (*elements)(const Job<Real>& job, Offset env) = nullptr;  ///< scratch it needs, in numbers of Real
  void (*solve)(const Job<Real>& job, Offset env, Real* scratch) = nullptr;
};

/// Kernels for environments in lock-step. A default one has no packs: width 1, and nothing may be called.
template <class Real>
struct PackKernels {
  int width = 1;                                          ///< environments in lock-step
  Offset (*elements)(const ConeCounts& slots) = nullptr;  ///< scratch they need, in numbers of Real
  /// Solves environments envs[0 .. count), all of dense path and with cones <= slots, `width` at a time.
  void (*solve)(const Job<Real>& job, const Offset* envs, Offset count, const ConeCounts& slots,
                Real* scratch) = nullptr;
};

/// One solver. Instruction sets replace `packs` whole: fields that belong together are never assigned one by one.
struct KernelSet {
  ByPrecision<SingleKernels> single;
  ByPrecisionAndLaw<PackKernels> packs;
};

/// The set with the packs of another build, if that has any.
inline KernelSet with_packs_of(const KernelSet& other, KernelSet set) {
  if (other.packs.f32[0].solve != nullptr) set.packs = other.packs;
  return set;
}

}  // namespace stiction::cpu
