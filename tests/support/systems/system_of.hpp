#pragma once

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/linear/block/wide_product.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// A system of one environment, whatever path the plan would choose.
namespace stiction::test {

template <class Real>
using Dense = DenseSystem<Real>;

/// Numbers that it takes.
template <class System, class Real>
Offset elements_of(const EnvView<Real>& env, const Workspace& workspace) {
  if constexpr (System::kMaintainsMotion) {
    return System::elements(env.counts, workspace);
  } else if constexpr (kHasVelocity<System>) {
    return System::elements(env.n, env.cone_count, env.dofs, workspace);
  } else {
    return System::elements(env.n, env.cone_count, env.entry_span(), workspace);
  }
}

/// The system in that memory.
template <class System, class Real>
System system_of(const EnvView<Real>& env, const Workspace& workspace, Real* memory) {
  if constexpr (System::kMaintainsMotion) {
    return System(env.counts, workspace, memory);
  } else {
    return System(env, workspace, memory);
  }
}

}  // namespace stiction::test
