#pragma once

#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "cpu_fallback/isa.hpp"

namespace stiction::test {

inline constexpr const char* kIsaNames[] = {"baseline", "avx2", "avx512"};

/// Asks for one build of the kernels while it lives, of solvers that are made then: best_isa() reads the variable, a
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

/// The builds that this CPU runs.
inline std::vector<const char*> usable_isas() {
  std::vector<const char*> usable;
  for (const char* name : kIsaNames) {
    const ScopedIsa isa(name);
    if (std::string(cpu::best_isa().name) == name) usable.push_back(name);
  }
  return usable;
}

}  // namespace stiction::test
