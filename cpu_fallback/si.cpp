#include "core/body/bodies/si_body.hpp"

#include "cpu_fallback/bodies_kernels.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, Law kLaw>
cpu::BodyKernels<Real> kernels() {
  using Method = BodySweeps<kLaw, Real>;
  using System = typename Method::System;
  return {System::elements, System::exact_elements, System::swept_elements, solve_alone<Method, Real>,
          solve_together<Method, Real>};
}

}  // namespace

cpu::BodyKernelSet si_kernels() {
  return {{kernels<float, Law::convex>(), kernels<float, Law::coulomb>()},
          {kernels<double, Law::convex>(), kernels<double, Law::coulomb>()}};
}

}  // namespace stiction::inline STICTION_ISA
