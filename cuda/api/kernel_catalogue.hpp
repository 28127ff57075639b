#pragma once

#include <array>
#include <cstddef>

#include "core/job/body_job.hpp"
#include "core/job/workspace.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// One solver, precision and law.
struct SolveKernels {
  KernelRef bundles;  ///< one lane per environment                                (kernels/solve_thread_per_env.hpp);
                      ///< none if the method factorises
  KernelRef dense;    ///< one team per environment, dense system                  (kernels/solve_teams.hpp)
  KernelRef sparse;   ///< one team per environment, sparse system
  KernelRef factor;   ///< one team per environment, factor and velocity
};

/// A solver's kernels by precision (Precision) and law (Law).
struct SolverKernels {
  SolveKernels by_precision_and_law[2][2];
  Workspace workspace;  ///< memory of the method beside the system
};

/// The scheduler's kernels; they read integers only.
struct PlanKernels {
  KernelRef inspect;  ///< soundness, cones by kind, path, class, canonical order   (kernels/plan_program.hpp)
  KernelRef sort;     ///< environments by class, most expensive class first
  KernelRef color;    ///< order and colours of sparse environments
  KernelRef islands;  ///< islands of all environments
};

/// The warm-start store, in one precision (kernels/warm_start_program.hpp).
struct WarmStartKernels {
  KernelRef load;   ///< first guesses
  KernelRef store;  ///< reactions, for the next step
  KernelRef reset;  ///< a mask of environments
};

/// Bodies, in one precision and law.
struct SolveBodyKernels {
  KernelRef bundles;  ///< one lane per environment             (kernels/body_bundles.hpp)
  KernelRef teams;    ///< one team per environment             (kernels/bodies_program.hpp)
};

/// Bodies by precision (Precision) and law of contacts (contact_law).
struct BodyKernels {
  SolveBodyKernels by_precision_and_law[2][kContactLaws];
};

/// Bodies by Newton's method, one team per environment, by precision and law  (kernels/bodies_program.hpp).
struct NewtonBodyKernels {
  KernelRef by_precision_and_law[2][2];
};

/// The Jacobian form, in one precision (kernels/jacobian_program.hpp).
struct JacobianKernels {
  KernelRef count;  ///< memory of each environment
  KernelRef place;  ///< where each begins
  KernelRef write;  ///< rows, A or Y, and b
  KernelRef move;   ///< velocities
};

/// Newton's method in velocities, with steps in one precision.
struct VelocityStepKernels {
  KernelRef teams{};     ///< a team for each environment                    (kernels/velocity_teams_program.hpp)
  KernelRef lanes{};     ///< a lane for each that these have not tried      (kernels/velocity_program.hpp)
  KernelRef in_parts{};  ///< in its place where some have more degrees of freedom than a lane takes
};

/// Newton's method in velocities, in one precision, before the Jacobian form's `place`.
struct VelocityKernels {
  VelocityStepKernels steps;
  VelocityStepKernels steps_in_double;  ///< before them, for environments in single precision; else none
  KernelRef in_blocks;  ///< after them, for their leftovers, by teams  (kernels/velocity_blocks_program.hpp)
};

struct DerivativePair {
  KernelRef vjp;  ///< cotangents of solutions back to their batches
  KernelRef jvp;  ///< changes of batches forward to their solutions
};
/// Derivatives of contact batches, in one precision (kernels/derivative_program.hpp).
struct DerivativeKernels {
  DerivativePair exact;
  DerivativePair relaxed;
  KernelRef unrolled_vjp;  ///< pulls cotangents of sweeps to their batches
  KernelRef lanes;         ///< before both by J and M, a lane each  (kernels/derivative_lanes_program.hpp)
};

/// Worlds, in one precision (kernels/world_program.hpp).
struct WorldKernels {
  KernelRef find;           ///< inputs of the solve, contacts of all pairs
  KernelRef find_near;      ///< inputs of the solve, contacts of the pairs that a tree finds
  KernelRef emit_contacts;  ///< contacts to the solver, with first guesses
  KernelRef integrate;      ///< positions
  KernelRef measure;        ///< energy and momentum
};

/// Every kernel of the library, compiled for one device. A feature adds its struct and one member here, fills it for
/// the emulated device in emulated_kernels.cpp and for CUDA in cuda_kernels.cpp.
struct KernelCatalogue {
  std::array<SolverKernels, kSolverKindCount> solvers;  ///< by SolverKind
  KernelRef trivial[2];  ///< by Precision                                  (kernels/trivial_program.hpp)
  KernelRef choose[2];   ///< by Precision                                  (kernels/choose_program.hpp)
  PlanKernels plan;
  WarmStartKernels warm_start[2];  ///< by Precision
  BodyKernels bodies;
  NewtonBodyKernels newton_bodies;
  JacobianKernels jacobian[2];      ///< by Precision
  VelocityKernels velocity[2];      ///< by Precision
  WorldKernels world[2];            ///< by Precision
  DerivativeKernels derivative[2];  ///< by Precision
};

}  // namespace stiction::cuda
