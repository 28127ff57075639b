#pragma once

#include "core/algorithm/driver/shared_instances.hpp"
#include "core/team/team.hpp"

/// Sweeps of single environments.
#define STICTION_SHARED_SWEEPS_OF(kind, Real, ...)                               \
  kind template Real common_sweep<Law::convex>(SerialTeam&, __VA_ARGS__&, Real); \
  kind template Real common_sweep<Law::coulomb>(SerialTeam&, __VA_ARGS__&, Real);
#define STICTION_SHARED_SWEEPS(kind)                              \
  STICTION_SHARED_SWEEPS_OF(kind, float, DenseSystem<float, 1>)   \
  STICTION_SHARED_SWEEPS_OF(kind, float, SparseSystem<float>)     \
  STICTION_SHARED_SWEEPS_OF(kind, float, FactorSystem<float>)     \
  STICTION_SHARED_SWEEPS_OF(kind, double, DenseSystem<double, 1>) \
  STICTION_SHARED_SWEEPS_OF(kind, double, SparseSystem<double>)   \
  STICTION_SHARED_SWEEPS_OF(kind, double, FactorSystem<double>)

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(extern, SerialTeam)
STICTION_SHARED_SWEEPS(extern)

}  // namespace stiction::inline STICTION_ISA
