#pragma once

#include "core/base/body_job.hpp"

namespace stiction::cpu {

class ThreadTeam;

/// Newton's method in body space, the same way.
template <class Real>
struct NewtonBodyKernels {
  /// Scratch one environment needs, in numbers of double besides what sequential impulses need.
  Offset (*doubles)(const BodyJob<Real>& job, Offset env);
  void (*solve_alone)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact);
  /// The same on every thread of a team, which shares the scratch.
  void (*solve_together)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact, ThreadTeam& team,
                         Index rank);
};

/// The most contacts and bodies of the environments that share a pack.
struct BodyRoom {
  Index contacts = 0;
  Index bodies = 0;
};

/// Sequential impulses under one law, compiled for one instruction set.
template <class Real>
struct BodyKernels {
  /// Scratch one environment needs, in numbers of Real and of double.
  Offset (*elements)(Offset contacts, Offset bodies, bool momentum);
  Offset (*exact_elements)(Offset bodies);
  /// Those of one contact that a sweep reads or writes.
  Offset (*swept_elements)(bool momentum);
  void (*solve_alone)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact);
  /// The same on every thread of a team, which shares the scratch.
  void (*solve_together)(const BodyJob<Real>& job, Offset env, Real* scratch, double* exact, ThreadTeam& team,
                         Index rank);
  int pack_width;  ///< environments in lock-step; 1: no packs, and the entries below are null
  /// Scratch that packs of that room need, in numbers of Real and of double.
  Offset (*pack_elements)(const BodyRoom& room, bool momentum);
  Offset (*pack_exact_elements)(const BodyRoom& room, bool momentum);
  /// Solves environments envs[0 .. count), all within `room`, `pack_width` at a time.
  void (*solve_pack)(const BodyJob<Real>& job, const Offset* envs, Offset count, const BodyRoom& room, Real* scratch,
                     double* exact);
};

/// Both precisions and laws.
struct BodyKernelSet {
  BodyKernels<float> f32[2];   ///< by Law
  BodyKernels<double> f64[2];  ///< by Law
};
struct NewtonBodyKernelSet {
  NewtonBodyKernels<float> f32[2];   ///< by Law
  NewtonBodyKernels<double> f64[2];  ///< by Law
};

}  // namespace stiction::cpu
