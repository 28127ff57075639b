#include "cpu_fallback/tables/isa.hpp"

#include <cstdlib>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "stiction/error.hpp"

namespace stiction {

#if defined(STICTION_HAS_BASELINE)
inline namespace isa_baseline {
cpu::NewtonBodyKernelSet newton_body_kernels();
cpu::KernelSet solver_kernels(SolverKind solver);
cpu::BodyKernelSet si_kernels();
cpu::DerivativeKernelSet derivative_kernels();
cpu::JacobianKernelSet jacobian_kernels();
cpu::WorldKernelSet world_kernels();
cpu::VelocityKernelSet velocity_kernels();
cpu::ArticulatedKernelSet articulated_kernels();
}  // namespace isa_baseline
#endif

#if defined(STICTION_HAS_AVX2)
namespace isa_avx2 {
cpu::NewtonBodyKernelSet newton_body_kernels();
cpu::KernelSet solver_kernels(SolverKind solver);
cpu::BodyKernelSet si_kernels();
cpu::DerivativeKernelSet derivative_kernels();
cpu::JacobianKernelSet jacobian_kernels();
cpu::WorldKernelSet world_kernels();
cpu::VelocityKernelSet velocity_kernels();
cpu::ArticulatedKernelSet articulated_kernels();
}  // namespace isa_avx2
#endif

#if defined(STICTION_HAS_AVX512)
namespace isa_avx512 {
cpu::KernelSet solver_kernels(SolverKind solver);
cpu::BodyKernelSet si_kernels();
cpu::ModePackKernelSet mode_pack_kernels();
cpu::VelocityKernelSet velocity_kernels();
cpu::ArticulatedKernelSet articulated_kernels();
}  // namespace isa_avx512
#endif

namespace cpu {

namespace {

#if defined(STICTION_HAS_AVX512)
bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}

/// Wider vectors make sweeps in packs faster; all else is that of AVX2.
KernelSet avx512_kernels(SolverKind solver) {
  return with_packs_of(isa_avx512::solver_kernels(solver), isa_avx2::solver_kernels(solver));
}
BodyKernelSet avx512_si_kernels() {
  BodyKernelSet set = isa_avx2::si_kernels();
  set.packs = isa_avx512::si_kernels().packs;
  return set;
}
DerivativeKernelSet avx512_derivative_kernels() {
  return isa_avx2::derivative_kernels().with(isa_avx512::mode_pack_kernels());
}
#endif

// Widest first. The baseline runs anywhere.
const Isa kIsas[] = {
#if defined(STICTION_HAS_AVX512)
    {"avx512", has_avx512, avx512_kernels, avx512_si_kernels, isa_avx2::newton_body_kernels, isa_avx2::jacobian_kernels,
     isa_avx2::world_kernels, isa_avx512::velocity_kernels, avx512_derivative_kernels, isa_avx512::articulated_kernels},
#endif
#if defined(STICTION_HAS_AVX2)
    {"avx2", [] { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }, isa_avx2::solver_kernels,
     isa_avx2::si_kernels, isa_avx2::newton_body_kernels, isa_avx2::jacobian_kernels, isa_avx2::world_kernels,
     isa_avx2::velocity_kernels, isa_avx2::derivative_kernels, isa_avx2::articulated_kernels},
#endif
#if defined(STICTION_HAS_BASELINE)
    {"baseline", [] { return true; }, isa_baseline::solver_kernels, isa_baseline::si_kernels,
     isa_baseline::newton_body_kernels, isa_baseline::jacobian_kernels, isa_baseline::world_kernels,
     isa_baseline::velocity_kernels, isa_baseline::derivative_kernels, isa_baseline::articulated_kernels},
#endif
};

/// Sets that a program adds, in the order they came.
std::vector<Isa>& added() {
  static std::vector<Isa> isas;
  return isas;
}

/// f(isa) of all builds, the library's and those that were added.
template <class F>
void for_each_isa(const F& f) {
  for (const Isa& isa : kIsas) f(isa);
  for (const Isa& isa : added()) f(isa);
}

/// Returns true if the name asks for the default choice.
bool is_widest(const char* name) {
  return *name == '\0' || std::strcmp(name, "widest") == 0;
}

bool is_built(const char* name) {
  bool found = false;
  for_each_isa([&](const Isa& isa) { found = found || std::strcmp(name, isa.name) == 0; });
  return found;
}

[[noreturn]] void refuse_name(const char* name) {
  std::string built;
  for_each_isa([&](const Isa& isa) { built += std::string(", ") + isa.name; });
  throw Error(ErrorCode::invalid_argument, std::string("STICTION_ISA = '") + name + "': expected one of widest" +
                                               built + ", the kernels of this build: unset it for the widest");
}

}  // namespace

bool add_isa(const Isa& isa) {
  added().push_back(isa);
  return true;
}

const Isa* find_isa(const char* name) {
  const auto usable = [&](const Isa& isa) { return std::strcmp(name, isa.name) == 0 && isa.supported(); };
  for (const Isa& isa : kIsas)
    if (usable(isa)) return &isa;
  for (const Isa& isa : added())
    if (usable(isa)) return &isa;
  return nullptr;
}

const Isa& widest_isa(std::span<const Isa> isas) {
  std::string names;
  for (const Isa& isa : isas) {
    if (isa.supported()) return isa;
    names += (names.empty() ? "" : ", ") + std::string(isa.name);
  }
  throw Error(ErrorCode::unsupported, "this processor runs none of the kernels of this build (" + names +
                                          "): build with -DSTICTION_CPU_KERNELS=all");
}

const Isa& best_isa() {
  const char* const wanted = std::getenv("STICTION_ISA");
  if (wanted != nullptr && !is_widest(wanted)) {
    if (const Isa* isa = find_isa(wanted)) return *isa;
    if (!is_built(wanted)) refuse_name(wanted);
  }
  return widest_isa(kIsas);
}

}  // namespace cpu
}  // namespace stiction
