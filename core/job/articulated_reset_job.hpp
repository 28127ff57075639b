#pragma once

#include <cstdint>

#include "stiction/articulated.hpp"

namespace stiction {

/// Environments that go back to a first state, at rest, without controls and forces.
template <class Real>
struct ArticulatedResetJob {
  ArticulatedView<Real> to;
  const std::uint8_t* mask;  ///< environments whose byte is not 0  (env_count)
  const Real* first;         ///< coordinates                       (q_count)
  Offset env_count;
  Index q_count, dof_count, actuator_count;
};

/// f(array) of all arrays that a reset writes.
template <class Real, class F>
void for_each_reset_array(const ArticulatedView<Real>& to, F&& f) {
  f(to.qpos);
  f(to.qvel);
  f(to.qacc);
  f(to.qfrc_applied);
  f(to.ctrl);
  f(to.time);
}

}  // namespace stiction
