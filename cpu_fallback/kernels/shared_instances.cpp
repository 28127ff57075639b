#include "cpu_fallback/tables/shared_instances.hpp"

#include "cpu_fallback/pack/shared_lanes.hpp"

namespace stiction::inline STICTION_ISA {

// Packs load their lanes themselves.
#if defined(STICTION_PACKS_ALONE)
template FinalResidual final_residual<false>(SerialTeam&, const EnvView<float>&, const StoredRows<float>&,
                                             const IslandShares<float>&, const ErrorScale&);
template FinalResidual final_residual<false>(SerialTeam&, const EnvView<double>&, const StoredRows<double>&,
                                             const IslandShares<double>&, const ErrorScale&);
#else
STICTION_SHARED_BODIES(, SerialTeam)
STICTION_SHARED_SWEEPS()
#endif
#if STICTION_VECTOR_BYTES > 0
STICTION_SHARED_LANES(, float)
STICTION_SHARED_LANES(, double)
#endif

}  // namespace stiction::inline STICTION_ISA
