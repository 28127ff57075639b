#include "cpu_fallback/job.hpp"

/// Whose kernels of the methods that factorise are run here.
#ifndef STICTION_DIRECT_ISA
#define STICTION_DIRECT_ISA STICTION_ISA
#endif

namespace stiction::inline STICTION_DIRECT_ISA {

cpu::KernelSet admm_kernels();
cpu::KernelSet newton_kernels();
cpu::KernelSet lemke_kernels();
cpu::KernelSet ipm_kernels();

}  // namespace stiction::inline STICTION_DIRECT_ISA

/// The solvers of one instruction set, by name. Compiled once for each.
namespace stiction::inline STICTION_ISA {

cpu::KernelSet pgs_kernels();
cpu::KernelSet npgs_kernels();
cpu::KernelSet jacobi_kernels();
cpu::KernelSet apgd_kernels();
cpu::KernelSet nsgs_kernels();

cpu::KernelSet solver_kernels(SolverKind solver) {
  switch (solver) {
    case SolverKind::pgs:
      return pgs_kernels();
    case SolverKind::npgs:
      return npgs_kernels();
    case SolverKind::jacobi:
      return jacobi_kernels();
    case SolverKind::apgd:
      return apgd_kernels();
    case SolverKind::nsgs:
      return nsgs_kernels();
    case SolverKind::admm:
      return STICTION_DIRECT_ISA::admm_kernels();
    case SolverKind::newton:
      return STICTION_DIRECT_ISA::newton_kernels();
    case SolverKind::lemke:
      return STICTION_DIRECT_ISA::lemke_kernels();
    case SolverKind::ipm:
      return STICTION_DIRECT_ISA::ipm_kernels();
    case SolverKind::multigrid:
    case SolverKind::automatic:
      break;
  }
  return npgs_kernels();
}

}  // namespace stiction::inline STICTION_ISA
