#pragma once

#include "core/base/macros.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"

namespace stiction::inline STICTION_ISA {

/// Pushes environments that lanes take forward, in packs that follow one another.
template <class Real>
void jacobian_jvp_all(const JacobianJvpJob<Real>& job, const LaneEnv<Real>* envs, JacobianPackResult* results,
                      Offset count, cpu::VelocityScratch& scratch);

}  // namespace stiction::inline STICTION_ISA
