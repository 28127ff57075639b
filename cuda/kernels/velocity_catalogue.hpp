#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/velocity_blocks_program.hpp"
#include "cuda/kernels/velocity_program.hpp"
#include "cuda/kernels/velocity_teams_program.hpp"

/// The part of a catalogue (catalogue.hpp) that Newton's method in velocities has. It is apart, as the method is long:
/// no other kernel is compiled anew when it changes.
namespace stiction::cuda {

template <class Make, class Real>
VelocityKernels velocity_kernels() {
  VelocityKernels kernels;
  kernels.steps = {Make::template kernel<SolveVelocityTeams<Real, Real>>("velocity_newton"),
                   Make::template kernel<SolveVelocities<Real, Real, false>>("velocity_newton_by_lanes"),
                   Make::template kernel<SolveVelocities<Real, Real, true>>("velocity_newton_in_parts")};
  if constexpr (sizeof(Real) < sizeof(double))
    kernels.steps_in_double = {
        Make::template kernel<SolveVelocityTeams<Real, double>>("velocity_newton_in_double"),
        Make::template kernel<SolveVelocities<Real, double, false>>("velocity_newton_by_lanes_in_double"),
        Make::template kernel<SolveVelocities<Real, double, true>>("velocity_newton_in_parts_in_double")};
  kernels.in_blocks = Make::template kernel<SolveVelocityBlocks<Real>>("velocity_newton_in_blocks");
  return kernels;
}

}  // namespace stiction::cuda
