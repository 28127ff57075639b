#include "core/body/bodies/si_body.hpp"

#include "cpu_fallback/bodies_kernels.hpp"
#include "cpu_fallback/body_pack_driver.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, Law kLaw>
cpu::BodyKernels<Real> kernels() {
  using Method = BodySweeps<kLaw, Real>;
  using System = typename Method::System;
  cpu::BodyKernels<Real> table{
      System::elements, System::exact_elements, System::swept_elements, nullptr, nullptr, 1, nullptr, nullptr, nullptr};
  if constexpr (!kPacksAlone) {
    table.solve_alone = solve_alone<Method, Real>;
    table.solve_together = solve_together<Method, Real>;
  }
  if constexpr (1 < kPackWidth<Real>) {
    table.pack_width = kPackWidth<Real>;
    table.pack_elements = body_pack_elements<kLaw, Real>;
    table.pack_exact_elements = body_pack_exact_elements<kLaw, Real>;
    table.solve_pack = solve_body_pack<kLaw, Real>;
  }
  return table;
}

}  // namespace

cpu::BodyKernelSet si_kernels() {
  return {{kernels<float, Law::convex>(), kernels<float, Law::coulomb>()},
          {kernels<double, Law::convex>(), kernels<double, Law::coulomb>()}};
}

}  // namespace stiction::inline STICTION_ISA
