#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/jacobian_program.hpp"
#include "cuda/kernels/velocity_blocks_program.hpp"
#include "cuda/kernels/velocity_program.hpp"

/// The Jacobian form's part of a catalogue (catalogue.hpp). It is apart, as Newton's method in velocities is long: no
/// other kernel is compiled anew when that changes.
namespace stiction::cuda {

template <class Make, class Real>
JacobianKernels jacobian_kernels() {
  return {Make::template kernel<CountJacobians<Real>>("jacobian_count"),
          Make::template kernel<PlaceJacobians<Real>>("jacobian_place"),
          Make::template kernel<WriteJacobians<Real>>("jacobian_write"),
          Make::template kernel<MoveJacobians<Real>>("jacobian_move"),
          Make::template kernel<SolveVelocities<Real, false>>("velocity_newton"),
          Make::template kernel<SolveVelocities<Real, true>>("velocity_newton_in_parts"),
          Make::template kernel<SolveVelocityBlocks<Real>>("velocity_newton_in_blocks")};
}

}  // namespace stiction::cuda
