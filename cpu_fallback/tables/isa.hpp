#pragma once

#include <span>

#include "cpu_fallback/tables/articulated_kernels.hpp"
#include "cpu_fallback/tables/body_kernels.hpp"
#include "cpu_fallback/tables/contact_kernels.hpp"
#include "cpu_fallback/tables/derivative_kernels.hpp"
#include "cpu_fallback/tables/jacobian_kernels.hpp"
#include "cpu_fallback/tables/velocity_kernels.hpp"
#include "cpu_fallback/tables/world_kernels.hpp"
#include "stiction/types.hpp"

namespace stiction::cpu {

/// One build of the kernels and whether this CPU can run it.
struct Isa {
  const char* name;
  bool (*supported)();
  KernelSet (*kernels)(SolverKind solver);
  BodyKernelSet (*body_kernels)();
  NewtonBodyKernelSet (*newton_body_kernels)();
  JacobianKernelSet (*jacobian)();
  WorldKernelSet (*world_kernels)();
  VelocityKernelSet (*velocity)();
  DerivativeKernelSet (*derivative)();
  ArticulatedKernelSet (*articulated)();
};

/// The widest build that this CPU runs. All builds give the same bits. The environment variable STICTION_ISA
/// (baseline, avx2, avx512) asks for a narrower one; widest, or nothing, for this one. Sets that the CPU cannot run
/// are not taken. \throws Error(invalid_argument) for a name that no build has, with the existing ones, and
/// Error(unsupported) where the library was built for another CPU alone.
const Isa& best_isa();

/// The first of `isas` that this CPU runs. \throws Error(unsupported) if it runs none.
const Isa& widest_isa(std::span<const Isa> isas);

/// The build of that name, or null where the CPU cannot run it or there is none.
const Isa* find_isa(const char* name);

/// Adds a build that only STICTION_ISA asks for. Tests add packs of widths that the machine at hand has no vectors for.
/// To be called before there are threads. Returns true, so that a constant's initialiser can call it.
bool add_isa(const Isa& isa);

}  // namespace stiction::cpu
