#pragma once

#include "core/base/macros.hpp"
#include "stiction/config.hpp"
#include "stiction/types.hpp"

/// The law as a constant of a kernel, or read from the system where a second kernel would gain nothing.
namespace stiction::inline STICTION_ISA {

/// The constant of kernels whose systems know their law.
inline constexpr Law kLawOfSystem{0xFF};

/// The law of a kernel's system, or of its environment.
template <Law kLaw, class System>
STICTION_HD Law law_of(const System& s) {
  if constexpr (kLaw == kLawOfSystem) {
    return s.law;
  } else {
    return kLaw;
  }
}

/// A law as the type of an argument.
template <Law kLaw>
struct LawConstant {
  static constexpr Law value = kLaw;
};

/// f(LawConstant) of the kernel's law, or of its system's.
template <Law kLaw, class System, class F>
STICTION_HD auto with_law(const System& s, F&& f) {
  if constexpr (kLaw != kLawOfSystem) {
    return f(LawConstant<kLaw>{});
  } else {
    return s.law == Law::coulomb ? f(LawConstant<Law::coulomb>{}) : f(LawConstant<Law::convex>{});
  }
}

}  // namespace stiction::inline STICTION_ISA
