#pragma once

#include "core/algorithm/driver/check_convergence.hpp"
#include "core/algorithm/residual/residual_estimate.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// Instances shared by all solvers on one kind of team: loading, the record of the best iterate, judging. It is
/// compiled once for a team instead of once for every solver. `kind` is `extern` where it is used and empty in the one
/// unit that holds it.
#define STICTION_SHARED_RECORDS(kind, BlockType, kMatrices, ...)                               \
  kind template void record_iterate<kMatrices, Law::convex>(BlockType&, __VA_ARGS__&,          \
                                                            Mask<typename __VA_ARGS__::Real>); \
  kind template void record_iterate<kMatrices, Law::coulomb>(BlockType&, __VA_ARGS__&,         \
                                                             Mask<typename __VA_ARGS__::Real>);

#define STICTION_SHARED_WITH_SYSTEM(kind, BlockType, Real, ...)                                       \
  kind template std::uint32_t load_system(BlockType&, const EnvView<Real>&, __VA_ARGS__&, LoadRules); \
  kind template void write_solution(BlockType&, const EnvView<Real>&, const __VA_ARGS__&);

#define STICTION_SHARED_BODIES_OF(kind, BlockType, Real)                                                       \
  kind template FinalResidual final_residual<false>(BlockType&, const EnvView<Real>&, const StoredRows<Real>&, \
                                                    const IslandShares<Real>&, const ErrorScale&);             \
  kind template FinalResidual final_residual<false>(BlockType&, const EnvView<Real>&, const FactorRows<Real>&, \
                                                    const IslandShares<Real>&, const ErrorScale&);             \
  kind template FinalResidual final_residual<true>(BlockType&, const EnvView<Real>&, const StoredRows<Real>&,  \
                                                   const IslandShares<Real>&, const ErrorScale&);              \
  kind template FinalResidual final_residual<true>(BlockType&, const EnvView<Real>&, const FactorRows<Real>&,  \
                                                   const IslandShares<Real>&, const ErrorScale&);              \
  STICTION_SHARED_RECORDS(kind, BlockType, true, FileOrderSystem<Real>)                                        \
  STICTION_SHARED_RECORDS(kind, BlockType, false, FileOrderSystem<Real>)                                       \
  STICTION_SHARED_RECORDS(kind, BlockType, false, DenseSystem<Real, 1>)                                        \
  STICTION_SHARED_WITH_SYSTEM(kind, BlockType, Real, DenseSystem<Real, 1>)                                     \
  STICTION_SHARED_WITH_SYSTEM(kind, BlockType, Real, SparseSystem<Real>)                                       \
  STICTION_SHARED_WITH_SYSTEM(kind, BlockType, Real, FactorSystem<Real>)

#define STICTION_SHARED_BODIES(kind, BlockType)     \
  STICTION_SHARED_BODIES_OF(kind, BlockType, float) \
  STICTION_SHARED_BODIES_OF(kind, BlockType, double)
