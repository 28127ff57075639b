#include "core/algorithm/rigid/asynchronous_sweeps.hpp"

#include "cpu_fallback/pack/body_pack_run.hpp"
#include "cpu_fallback/tables/solve_bodies.hpp"

namespace stiction::inline STICTION_ISA {

namespace {

template <class Real, Law kLaw>
cpu::BodySingleKernels<Real> single() {
  if constexpr (kPacksAlone) {
    return {};
  } else {
    using Method = BodySweeps<kLaw, Real>;
    using System = typename Method::System;
    return {System::elements, System::exact_elements, System::swept_elements, solve_alone<Method, Real>,
            solve_together<DealtSweeps<kLaw, Real>, Real>};
  }
}

template <class Real, Law kLaw>
cpu::BodyPackKernels<Real> packs() {
  if constexpr (1 < kPackWidth<Real> && !kSinglesAlone) {
    return {kPackWidth<Real>, body_pack_elements<kLaw, Real>, body_pack_exact_elements<kLaw, Real>,
            solve_body_pack<kLaw, Real>};
  } else {
    return {};
  }
}

}  // namespace

cpu::BodyKernelSet si_kernels() {
  constexpr Law kConvex = Law::convex, kCoulomb = Law::coulomb;
  return {{{single<float, kConvex>(), single<float, kCoulomb>(), single<float, kBoxFriction>()},
           {single<double, kConvex>(), single<double, kCoulomb>(), single<double, kBoxFriction>()}},
          {{packs<float, kConvex>(), packs<float, kCoulomb>(), packs<float, kBoxFriction>()},
           {packs<double, kConvex>(), packs<double, kCoulomb>(), packs<double, kBoxFriction>()}}};
}

}  // namespace stiction::inline STICTION_ISA
