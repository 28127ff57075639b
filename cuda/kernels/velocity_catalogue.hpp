#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/velocity_blocks_program.hpp"
#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"

/// The part of a catalogue (catalogue.hpp) that Newton's method in velocities has. It is apart, as the method is long:
/// no other kernel is compiled anew when it changes.
namespace stiction::cuda {

/// Adds kernels for environments of up to kMostVelocityDofs.
template <class Make, class Real>
void add_velocity_kernels(VelocityKernels& to) {
  to.steps.teams = Make::template kernel<SolveVelocityTeams<Real, Real>>("velocity_newton");
  to.steps.lanes = Make::template kernel<SolveVelocities<Real, Real, false>>("velocity_newton_by_lanes");
  if constexpr (sizeof(Real) < sizeof(double)) {
    to.steps_in_double.teams = Make::template kernel<SolveVelocityTeams<Real, double>>("velocity_newton_in_double");
    to.steps_in_double.lanes =
        Make::template kernel<SolveVelocities<Real, double, false>>("velocity_newton_by_lanes_in_double");
  }
}

/// Adds kernels for larger ones.
template <class Make, class Real>
void add_velocity_part_kernels(VelocityKernels& to) {
  to.steps.in_parts = Make::template kernel<SolveVelocities<Real, Real, true>>("velocity_newton_in_parts");
  if constexpr (sizeof(Real) < sizeof(double))
    to.steps_in_double.in_parts =
        Make::template kernel<SolveVelocities<Real, double, true>>("velocity_newton_in_parts_in_double");
  to.in_blocks = Make::template kernel<SolveVelocityBlocks<Real>>("velocity_newton_in_blocks");
}

template <class Make, class Real>
VelocityKernels velocity_kernels() {
  VelocityKernels kernels;
  add_velocity_kernels<Make, Real>(kernels);
  add_velocity_part_kernels<Make, Real>(kernels);
  return kernels;
}

}  // namespace stiction::cuda
