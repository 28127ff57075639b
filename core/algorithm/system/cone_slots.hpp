#pragma once

#include "core/algorithm/system/batch_order_system.hpp"
#include "core/algorithm/system/dense_system.hpp"

namespace stiction::inline STICTION_ISA {

/// Visits this environment's cones as (cone of the batch, slot in the system); the calls must not depend on each
/// other.
template <Team TeamT, class Real, int kStride, class F>
STICTION_HD void for_each_slot(TeamT& team, const EnvView<Real>& env, const DenseSystem<Real, kStride>& s, F&& f) {
  for_each(team, env.cone_count,
           [&](Index position) { f(env.cone_order[position], locate(env.counts, s.counts, position)); });
}
/// Visits the cones by a team of one, kind after kind.
template <Team TeamT, class Real, int kStride, class F>
  requires(TeamT::size() == 1)
STICTION_HD void for_each_slot(TeamT&, const EnvView<Real>& env, const DenseSystem<Real, kStride>& s, F&& f) {
  Index position = 0;
  ConeSlot first{0, 0};
  for (int shape = 0; shape < kConeShapes; ++shape) {
    const Index own = shape_count(env.counts, shape);
    const Index rows = shape_rows(shape);
    for (Index k = 0; k < own; ++k) f(env.cone_order[position + k], ConeSlot{first.cone + k, first.row + k * rows});
    position += own;
    first.cone += shape_count(s.counts, shape);
    first.row += shape_count(s.counts, shape) * rows;
  }
}
template <Team TeamT, class Real, class F>
STICTION_HD void for_each_slot(TeamT& team, const EnvView<Real>& env, const FileOrderSystem<Real>&, F&& f) {
  for_each(team, env.cone_count, [&](Index cone) { f(cone, ConeSlot{cone, env.cone_row(cone)}); });
}

}  // namespace stiction::inline STICTION_ISA
