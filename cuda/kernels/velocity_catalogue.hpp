#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/velocity_blocks_program.hpp"
#include "cuda/kernels/velocity_program.hpp"

/// The part of a catalogue (catalogue.hpp) that Newton's method in velocities has. It is apart, as the method is long:
/// no other kernel is compiled anew when it changes.
namespace stiction::cuda {

template <class Make, class Real>
VelocityLanes double_lanes() {
  if constexpr (sizeof(Real) == sizeof(double)) {
    return {};
  } else {
    return {Make::template kernel<SolveVelocities<Real, double, false>>("velocity_newton_in_double"),
            Make::template kernel<SolveVelocities<Real, double, true>>("velocity_newton_in_parts_in_double")};
  }
}

template <class Make, class Real>
VelocityKernels velocity_kernels() {
  return {{Make::template kernel<SolveVelocities<Real, Real, false>>("velocity_newton"),
           Make::template kernel<SolveVelocities<Real, Real, true>>("velocity_newton_in_parts")},
          double_lanes<Make, Real>(),
          Make::template kernel<SolveVelocityBlocks<Real>>("velocity_newton_in_blocks")};
}

}  // namespace stiction::cuda
