#include "cpu_fallback/kernels/shared_instances.hpp"

namespace stiction::inline STICTION_ISA {

// Packs load their lanes themselves.
#if defined(STICTION_PACKS_ALONE)
template FinalResidual final_residual(SerialTeam&, const EnvView<float>&, const StoredRows<float>&);
template FinalResidual final_residual(SerialTeam&, const EnvView<double>&, const StoredRows<double>&);
#else
STICTION_SHARED_BODIES(, SerialTeam)
#endif

}  // namespace stiction::inline STICTION_ISA
