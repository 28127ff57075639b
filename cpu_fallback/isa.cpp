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

#if defined(STICTION_HAS_AVX512)
namespace isa_avx512 {
cpu::KernelSet npgs_kernels();
cpu::KernelSet pgs_kernels();
cpu::BodyKernelSet si_kernels();
cpu::KernelSet subspace_kernels();
}  // namespace isa_avx512
#endif

namespace cpu {

namespace {

#if defined(STICTION_HAS_AVX512)
bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}

/// `all` with the packs of `wider`, a set of kernels for packs alone.
template <class Set>
Set with_packs_of(const Set& wider, Set all) {
  const auto take = [](auto& kernels, const auto& packs) {
    kernels.pack_width = packs.pack_width;
    kernels.pack_elements = packs.pack_elements;
    kernels.solve_pack = packs.solve_pack;
  };
  for (int law = 0; law < 2; ++law) {
    take(all.f32[law], wider.f32[law]);
    take(all.f64[law], wider.f64[law]);
  }
  return all;
}

/// Sweeps in packs are what wider vectors make faster; all else is that of AVX2.
KernelSet avx512_kernels(SolverKind solver) {
  const KernelSet narrower = isa_avx2::solver_kernels(solver);
  if (solver == SolverKind::npgs) return with_packs_of(isa_avx512::npgs_kernels(), narrower);
  if (solver == SolverKind::pgs) return with_packs_of(isa_avx512::pgs_kernels(), narrower);
  if (solver == SolverKind::subspace) return with_packs_of(isa_avx512::subspace_kernels(), narrower);
  return narrower;
}
BodyKernelSet avx512_si_kernels() {
  return with_packs_of(isa_avx512::si_kernels(), isa_avx2::si_kernels());
}
#endif

// Widest first; the last one runs anywhere.
const Isa kIsas[] = {
#if defined(STICTION_HAS_AVX512)
    {"avx512", has_avx512, avx512_kernels, avx512_si_kernels, isa_avx2::newton_body_kernels, isa_avx2::jacobian_kernels,
     isa_avx2::world_kernels},
#endif
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
