#pragma once

#include <cstdint>

namespace stiction::distributed {

/// Of this process, the most so far [bytes]; 0 where Linux's /proc is not there.
std::int64_t peak_memory();

}  // namespace stiction::distributed
