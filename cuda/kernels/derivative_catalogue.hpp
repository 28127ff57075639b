#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/derivative_lanes_program.hpp"
#include "cuda/kernels/derivative_program.hpp"

/// The part of a catalogue that derivatives are (catalogue.hpp). Apart, so that no solver is compiled anew for them.
namespace stiction::cuda {

template <class Make, class Real>
DerivativePair derivative_kernels() {
  return {Make::template kernel<VjpProgram<Real, false>>("derivative_vjp"),
          Make::template kernel<JvpProgram<Real, false>>("derivative_jvp")};
}
template <class Make, class Real>
DerivativePair relaxed_kernels() {
  return {Make::template kernel<VjpProgram<Real, true>>("relaxed_vjp"),
          Make::template kernel<JvpProgram<Real, true>>("relaxed_jvp")};
}
template <class Make, class Real>
KernelRef unrolled_kernel() {
  return Make::template kernel<UnrolledVjpProgram<Real>>("unrolled_vjp");
}
template <class Make, class Real>
KernelRef lanes_kernel() {
  return Make::template kernel<DerivativeLanesProgram<Real>>("derivative_lanes");
}
template <class Make, class Real>
DerivativeKernels all_derivative_kernels() {
  return {derivative_kernels<Make, Real>(), relaxed_kernels<Make, Real>(), unrolled_kernel<Make, Real>(),
          lanes_kernel<Make, Real>()};
}

}  // namespace stiction::cuda
