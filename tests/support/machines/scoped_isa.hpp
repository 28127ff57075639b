#pragma once

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "cpu_fallback/tables/isa.hpp"

namespace stiction::test {

/// The builds of the library, narrowest first.
inline constexpr const char* kShippedIsas[] = {"baseline", "avx2", "avx512"};
/// Packs of 16 and 64 bytes that tests add (tests/isa/pack_width.cpp), where the build has AVX2.
inline constexpr const char* kTestedWidths[] = {"narrow", "wide"};

/// Requests one build of the kernels while it lives, of solvers that are made then. best_isa() reads the variable: a
/// Solver when it is constructed, bodies, Jacobians and worlds at every solve.
class ScopedIsa {
 public:
  explicit ScopedIsa(const char* name) {
    if (const char* before = std::getenv("STICTION_ISA")) before_ = before;
    setenv("STICTION_ISA", name, 1);
  }
  ~ScopedIsa() {
    if (before_) {
      setenv("STICTION_ISA", before_->c_str(), 1);
    } else {
      unsetenv("STICTION_ISA");
    }
  }
  ScopedIsa(const ScopedIsa&) = delete;
  ScopedIsa& operator=(const ScopedIsa&) = delete;

 private:
  std::optional<std::string> before_;
};

/// The builds of the library that this CPU runs.
inline std::vector<const char*> usable_shipped_isas() {
  std::vector<const char*> usable;
  for (const char* name : kShippedIsas)
    if (cpu::find_isa(name) != nullptr) usable.push_back(name);
  return usable;
}

/// The first of them: the baseline, unless the build is for this machine alone.
inline const char* narrowest_isa() {
  return usable_shipped_isas().front();
}

/// And the widths of packs that tests add.
inline std::vector<const char*> usable_isas() {
  std::vector<const char*> usable = usable_shipped_isas();
  for (const char* name : kTestedWidths)
    if (cpu::find_isa(name) != nullptr) usable.push_back(name);
  return usable;
}

}  // namespace stiction::test
