#pragma once

#include "stiction/config.hpp"

/// Included first by a source whose kernels have copies of the functions that are calls elsewhere. Addresses of a
/// workspace's arrays are then in registers. A call reads them from local memory, again after every number it writes.
/// It ends at #pragma pop_macro("STICTION_HD_OUTLINE").
#pragma push_macro("STICTION_HD_OUTLINE")
#undef STICTION_HD_OUTLINE
#define STICTION_HD_OUTLINE STICTION_HD
