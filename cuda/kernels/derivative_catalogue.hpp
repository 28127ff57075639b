#pragma once

#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/kernels/derivative_program.hpp"

/// The part of a catalogue that derivatives are (catalogue.hpp). Apart, so that no solver is compiled anew for them.
namespace stiction::cuda {

template <class Make, class Real>
DerivativeKernels derivative_kernels() {
  return {Make::template kernel<PullBack<Real>>("derivative_vjp"),
          Make::template kernel<PushForward<Real>>("derivative_jvp")};
}

}  // namespace stiction::cuda
