#include "core/algorithm/driver/shared_instances.hpp"
#include "cuda/emulated/emulated_team.hpp"

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(, cuda::EmulatedTeam)
STICTION_SHARED_WITH_SYSTEM(, SerialTeam, float, DenseSystem<float, cuda::kWarp>)
STICTION_SHARED_RECORDS(, SerialTeam, false, DenseSystem<float, cuda::kWarp>)
STICTION_SHARED_WITH_SYSTEM(, SerialTeam, double, DenseSystem<double, cuda::kWarp>)
STICTION_SHARED_RECORDS(, SerialTeam, false, DenseSystem<double, cuda::kWarp>)

}  // namespace stiction::inline STICTION_ISA
