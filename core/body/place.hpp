#pragma once

#include "core/body/dense_system.hpp"
#include "core/body/file_order_system.hpp"

namespace stiction::inline STICTION_ISA {

/// Visits this environment's cones as (cone of the batch, place in the system); the calls must not depend on each
/// other.
template <Block B, class Real, int kStride, class F>
STICTION_HD void for_each_place(B& block, const EnvView<Real>& env, const DenseSystem<Real, kStride>& s, F&& f) {
  for_each(block, env.cone_count,
           [&](Index position) { f(env.cone_order[position], locate(env.counts, s.counts, position)); });
}
template <Block B, class Real, class F>
STICTION_HD void for_each_place(B& block, const EnvView<Real>& env, const FileOrderSystem<Real>&, F&& f) {
  for_each(block, env.cone_count, [&](Index cone) { f(cone, ConePlace{cone, env.cone_row(cone)}); });
}

}  // namespace stiction::inline STICTION_ISA
