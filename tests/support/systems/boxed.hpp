#pragma once

#include <cstddef>

#include "stiction/batch.hpp"

namespace stiction::test {

/// The environment with its friction cones boxed: all, or every other one.
inline Environment<double> boxed(Environment<double> env, bool all = true) {
  std::size_t met = 0;
  for (auto& cone : env.cones)
    if (cone.kind == ConeKind::friction && (met++ % 2 == 0 || all)) cone.kind = ConeKind::box_friction;
  return env;
}

}  // namespace stiction::test
