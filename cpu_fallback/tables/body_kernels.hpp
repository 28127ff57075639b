#pragma once

#include "core/job/body_job.hpp"
#include "cpu_fallback/tables/kernel_tables.hpp"

namespace stiction::cpu {

class ThreadTeam;

/// Newton's method in body space, the same way.
template <class Real>
struct NewtonBodyKernels {
  /// Scratch of one environment, in numbers of double besides those of sequential impulses.
  Offset (*doubles)(const BodyJob<Real>& job, Offset env);
  void (*solve_alone)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact);
  /// Solves on every thread of a team, which shares the scratch.
  void (*solve_together)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact, ThreadTeam& team,
                         Index rank);
};

/// The most contacts and bodies of the environments that share a pack.
struct PackShape {
  Index contacts = 0;
  Index bodies = 0;
  friend bool operator==(const PackShape&, const PackShape&) = default;
};

/// Sequential impulses under one law on one environment at a time.
template <class Real>
struct BodySingleKernels {
  /// Scratch one environment needs, in numbers of Real and of double.
  Offset (*elements)(Offset contacts, Offset bodies, bool momentum) = nullptr;
  Offset (*exact_elements)(Offset bodies) = nullptr;
  /// Returns the elements of one contact that a sweep reads or writes.
  Offset (*swept_elements)(bool momentum) = nullptr;
  void (*solve_alone)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact) = nullptr;
  /// Solves on every thread of a team, which shares the scratch.
  void (*solve_together)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact, ThreadTeam& team,
                         Index rank) = nullptr;
};

/// Kernels for environments in lock-step. A default one has no packs: width 1, and nothing may be called.
template <class Real>
struct BodyPackKernels {
  int width = 1;  ///< environments in lock-step
  /// Scratch that packs of that shape need, in numbers of Real and of double.
  Offset (*elements)(const PackShape& shape, bool momentum) = nullptr;
  Offset (*exact_elements)(const PackShape& shape, bool momentum) = nullptr;
  /// Solves environments envs[0 .. count), all within `shape`, `width` at a time.
  void (*solve)(const BodyJob<Real>& job, const Offset* envs, Offset count, const PackShape& shape, Real* scratch,
                double* exact) = nullptr;
};

/// Sequential impulses, by every law of contacts, boxed friction included. Instruction sets replace `packs` whole.
struct BodyKernelSet {
  ByPrecisionAndLaw<BodySingleKernels, kContactLaws> single;
  ByPrecisionAndLaw<BodyPackKernels, kContactLaws> packs;
};
using NewtonBodyKernelSet = ByPrecisionAndLaw<NewtonBodyKernels>;

}  // namespace stiction::cpu
