#pragma once

#include <functional>

#include "stiction/types.hpp"

namespace stiction {

/// Shares [0, count) out. Calls work(begin, end) for parts that cover it, in any order and perhaps at the same time,
/// and returns when all are done. Results for a part must not depend on how it was cut.
using ParallelFor = std::function<void(Offset count, const std::function<void(Offset, Offset)>& work)>;

/// All of it in one part, by the caller.
inline void all_at_once(Offset count, const std::function<void(Offset, Offset)>& work) {
  if (count > 0) work(0, count);
}

}  // namespace stiction
