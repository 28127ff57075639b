#include "cpu_fallback/shared_bodies.hpp"

namespace stiction::inline STICTION_ISA {

STICTION_SHARED_BODIES(, SerialBlock)

}  // namespace stiction::inline STICTION_ISA
