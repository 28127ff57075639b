#include "cpu_fallback/tables/isa.hpp"

/// A build of the kernels for packs of one width, whatever vectors the machine has, under a separate name
/// (STICTION_ISA=narrow, =wide). It goes through the tables that AVX-512 goes through. Compiled once for each width.
namespace stiction::inline STICTION_ISA {

cpu::KernelSet solver_kernels(SolverKind solver);
cpu::ModePackKernelSet mode_pack_kernels();
cpu::BodyKernelSet si_kernels();
cpu::JacobianKernelSet jacobian_kernels();
cpu::VelocityKernelSet velocity_kernels();
cpu::ArticulatedKernelSet articulated_kernels();

namespace {

/// Kernels of all but packs. Vectors of 64 bytes are split into those of AVX2, which a build for one machine has alone.
const cpu::Isa* single_environments() {
  const cpu::Isa* const baseline = STICTION_VECTOR_BYTES > 16 ? nullptr : cpu::find_isa("baseline");
  return baseline != nullptr ? baseline : cpu::find_isa("avx2");
}

cpu::KernelSet kernels(SolverKind solver) {
  return cpu::with_packs_of(solver_kernels(solver), single_environments()->kernels(solver));
}

cpu::BodyKernelSet body_kernels() {
  cpu::BodyKernelSet set = single_environments()->body_kernels();
  set.packs = si_kernels().packs;
  return set;
}

[[maybe_unused]] const bool kAdded =
    cpu::add_isa({STICTION_ISA_NAME, [] { return single_environments() != nullptr; }, kernels, body_kernels,
                  [] { return single_environments()->newton_body_kernels(); }, jacobian_kernels,
                  [] { return single_environments()->world_kernels(); }, velocity_kernels,
                  [] { return single_environments()->derivative().with(mode_pack_kernels()); }, articulated_kernels});

}  // namespace

}  // namespace stiction::inline STICTION_ISA
