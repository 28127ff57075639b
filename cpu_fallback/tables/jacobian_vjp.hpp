#pragma once

#include "core/base/macros.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::inline STICTION_ISA {

/// Pulls environments back, or parts of some, that lanes take, in packs that follow one another.
template <class Real>
void jacobian_vjp_all(const JacobianVjpJob<Real>& job, const LaneEnv<Real>* envs, JacobianPackResult* results,
                      Offset count, cpu::VelocityScratch& scratch);

}  // namespace stiction::inline STICTION_ISA
