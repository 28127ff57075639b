#include "core/algorithm/driver/shared_instances.hpp"
#include "cuda/device/host_team.hpp"

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(, cuda::HostTeam)
STICTION_SHARED_WITH_SYSTEM(, SerialBlock, float, DenseSystem<float, cuda::kWarp>)
STICTION_SHARED_WITH_SYSTEM(, SerialBlock, double, DenseSystem<double, cuda::kWarp>)

}  // namespace stiction::inline STICTION_ISA
