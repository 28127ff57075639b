#pragma once

#include <array>

namespace stiction {

/// Derivative of the spin that a step of a world ends with by the spin that its contacts left, row by row. A body keeps
/// its angular momentum while it turns (docs/howto/stepping.md). orientation: unit quaternion (w, x, y, z) at the
/// beginning. inertia: principal moments [kg m^2]. spin: as the contacts left it [rad/s]. step [s].
std::array<double, 9> spin_change(const std::array<double, 4>& orientation, const std::array<double, 3>& inertia,
                                  const std::array<double, 3>& spin, double step);

}  // namespace stiction
