#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/jacobian_program.hpp"

/// The Jacobian form's part of a catalogue (catalogue.hpp).
namespace stiction::cuda {

template <class Make, class Real>
JacobianKernels jacobian_kernels() {
  return {Make::template kernel<CountJacobians<Real>>("jacobian_count"),
          Make::template kernel<PlaceJacobians<Real>>("jacobian_place"),
          Make::template kernel<WriteJacobians<Real>>("jacobian_write"),
          Make::template kernel<MoveJacobians<Real>>("jacobian_move")};
}

}  // namespace stiction::cuda
