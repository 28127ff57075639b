#pragma once

#include <cstdint>

namespace stiction::distributed {

/// Returns the peak memory of this process [bytes]; 0 where Linux's /proc is not there.
std::int64_t peak_memory();

}  // namespace stiction::distributed
