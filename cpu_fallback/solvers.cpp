#include "cpu_fallback/job.hpp"

/// The solvers of one instruction set, by name. Compiled once for each.
namespace stiction::inline STICTION_ISA {

cpu::KernelSet pgs_kernels();
cpu::KernelSet npgs_kernels();
cpu::KernelSet jacobi_kernels();
cpu::KernelSet apgd_kernels();
cpu::KernelSet nsgs_kernels();
cpu::KernelSet admm_kernels();
cpu::KernelSet newton_kernels();
cpu::KernelSet lemke_kernels();
cpu::KernelSet ipm_kernels();
cpu::KernelSet subspace_kernels();

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
      return admm_kernels();
    case SolverKind::newton:
      return newton_kernels();
    case SolverKind::lemke:
      return lemke_kernels();
    case SolverKind::ipm:
      return ipm_kernels();
    case SolverKind::subspace:
      return subspace_kernels();
    case SolverKind::multigrid:
    case SolverKind::automatic:
      break;
  }
  return npgs_kernels();
}

}  // namespace stiction::inline STICTION_ISA
