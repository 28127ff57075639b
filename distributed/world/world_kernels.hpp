#pragma once

#include "cpu_fallback/tables/isa.hpp"

namespace stiction::distributed {

/// The stages of a step that the CPU's worlds run.
template <class Real>
cpu::WorldKernels<Real> world_kernels();

}  // namespace stiction::distributed
