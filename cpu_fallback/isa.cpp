#include "cpu_fallback/isa.hpp"

#include <cstdlib>
#include <cstring>

namespace stiction {

namespace isa_baseline {
cpu::NewtonBodyKernelSet newton_body_kernels();
cpu::KernelSet solver_kernels(SolverKind solver);
cpu::BodyKernelSet si_kernels();
cpu::JacobianKernelSet jacobian_kernels();
cpu::WorldKernelSet world_kernels();
}  // namespace isa_baseline

#if defined(STICTION_HAS_AVX2)
namespace isa_avx2 {
cpu::NewtonBodyKernelSet newton_body_kernels();
cpu::KernelSet solver_kernels(SolverKind solver);
cpu::BodyKernelSet si_kernels();
cpu::JacobianKernelSet jacobian_kernels();
cpu::WorldKernelSet world_kernels();
}  // namespace isa_avx2
#endif

namespace cpu {

namespace {

// Widest first; the last one runs anywhere.
const Isa kIsas[] = {
#if defined(STICTION_HAS_AVX2)
    {"avx2", [] { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }, isa_avx2::solver_kernels,
     isa_avx2::si_kernels, isa_avx2::newton_body_kernels, isa_avx2::jacobian_kernels, isa_avx2::world_kernels},
#endif
    {"baseline", [] { return true; }, isa_baseline::solver_kernels, isa_baseline::si_kernels,
     isa_baseline::newton_body_kernels, isa_baseline::jacobian_kernels, isa_baseline::world_kernels},
};

const Isa& choose_isa() {
  const char* wanted = std::getenv("STICTION_ISA");
  for (const Isa& isa : kIsas)
    if (isa.supported() && (wanted == nullptr || std::strcmp(wanted, isa.name) == 0)) return isa;
  for (const Isa& isa : kIsas)
    if (isa.supported()) return isa;
  return kIsas[sizeof(kIsas) / sizeof(kIsas[0]) - 1];
}

}  // namespace

const Isa& best_isa() {
  return choose_isa();
}

}  // namespace cpu
}  // namespace stiction
