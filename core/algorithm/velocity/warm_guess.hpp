#pragma once

#include "core/algorithm/velocity/newton_progress.hpp"
#include "core/algorithm/velocity/velocity_workspace.hpp"

namespace stiction::inline STICTION_ISA {

/// A warm start's reactions, which have been evaluated, as a place to start from.
template <class Types>
struct WarmGuess {
  using Real = typename Types::Real;
  const VelocityWorkspace<Types>& workspace;
  const Slot<Types::kLanes>* slots;
  const SlotCounts& counts;

  /// The motion z at which a lane's reactions would be the guess, and by how much it differs from what the guess leads
  /// to. Reactions answer to z over R, so that what a guess leads to would say nothing of which contacts stick.
  STICTION_HD_OUTLINE void aim(int l) const {
    for (Index s = 0; s < counts.slots; ++s) {
      const Slot<Types::kLanes>& slot = slots[s];
      const auto put = [&](Index k, double aim) {
        const Offset row = slot.row + k;
        const double led_to =
            workspace.motion[row * Types::kStride + l] -
            static_cast<double>(workspace.R.at(row, l)) * static_cast<double>(workspace.x.at(row, l)) +
            static_cast<double>(workspace.shift.at(row, l));
        workspace.z.at(row, l) = static_cast<Real>(aim);
        workspace.line.at(row, l) = static_cast<Real>(aim - led_to);
      };
      const auto motion = [&](Index k) { return workspace.motion[Offset{slot.row + k} * Types::kStride + l]; };
      const auto reaction = [&](Index k) { return static_cast<double>(workspace.x.at(slot.row + k, l)); };
      const double normal = div_(1.0, static_cast<double>(workspace.law.at(3 * s, l)));
      if (slot.rows == 1) {
        const double lo = static_cast<double>(workspace.law.at(3 * s + 1, l));
        const double hi = static_cast<double>(workspace.law.at(3 * s + 2, l));
        const bool pushes = (reaction(0) <= lo && motion(0) > 0.0) || (reaction(0) >= hi && motion(0) < 0.0);
        const double away = pushes ? motion(0) : 0.0;
        put(0, away - normal * reaction(0));
        continue;
      }
      const double tangential = div_(1.0, static_cast<double>(workspace.law.at(3 * s + 1, l)));
      double square = 0.0;
      double length = 0.0;
      for (Index k = 1; k < slot.rows; ++k) {
        const double mu = static_cast<double>(workspace.mu.at(slot.row + k, l));
        const double x = mu > 0.0 ? div_(reaction(k), mu) : 0.0;
        const double z = mu * motion(k) - tangential * x;
        square = fma_(x, x, square);
        length = fma_(z, z, length);
      }
      length = sqrt_(length);
      const bool is_open = !(reaction(0) > 0.0);
      const bool sticks = !is_open && sqrt_(square) < kInsideCone * reaction(0);
      for (Index k = 1; k < slot.rows; ++k) {
        const double mu = static_cast<double>(workspace.mu.at(slot.row + k, l));
        // Per unit of the scaled reaction: R where it sticks, what it slides by where it slides.
        const double size = sticks ? tangential : div_(length, sqrt_(square));
        put(k, is_open ? motion(k) : mu > 0.0 ? 0.0 - div_(size * reaction(k), mu * mu) : 0.0);
      }
      put(0, is_open  ? max_(motion(0), length)
             : sticks ? 0.0 - normal * reaction(0)
                      : length - (normal + tangential) * reaction(0));
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
