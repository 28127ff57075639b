#pragma once

#include "core/algorithm/velocity/evaluate/evaluate_pack.hpp"

namespace stiction::inline STICTION_ISA {

/// A warm start's reactions, which have been evaluated, as a place to start from.
template <class Types>
struct WarmGuess {
  using Double = typename Types::Double;
  const DoublePack<Types>& pack;

  /// The motion z at which the reactions would be the guess, and its difference from the motion of the guess.
  /// Reactions answer to z over R, so the motion of a guess would not tell which contacts stick.
  STICTION_HD_OUTLINE void aim() const {
    pack.workspace.each(pack.counts.slots, [&](Index s) {
      const auto& slot = pack.slots[s];
      if (slot.rows == 1) {
        aim_row(s, slot.row);
        return;
      }
      with_shape(ConeKind::friction, slot.rows, [&](auto shape) {
        if constexpr (decltype(shape)::kKind == ConeKind::friction) aim_cone<decltype(shape)::kRows>(s, slot.row);
      });
    });
  }

 private:
  [[nodiscard]] STICTION_HD Double reaction(Index row) const { return pack.number(pack.workspace.x, row); }
  [[nodiscard]] STICTION_HD Double motion(Index row) const { return pack.array(pack.workspace.motion)[row]; }

  STICTION_HD void put(Index row, Double aim) const {
    const auto& workspace = pack.workspace;
    const Double led_to =
        (motion(row) - pack.number(workspace.R, row) * reaction(row)) + pack.number(workspace.shift, row);
    pack.put(workspace.z, row, aim);
    pack.put(workspace.Jp, row, aim - led_to);
  }

  STICTION_HD void aim_row(Index s, Index row) const {
    const auto& law = pack.workspace.law;
    const Double x = reaction(row), moves = motion(row);
    const auto pushes = or_(and_(x <= pack.number(law, 3 * s + 1), moves > Double(0)),
                            and_(x >= pack.number(law, 3 * s + 2), moves < Double(0)));
    put(row, select(pushes, moves, Double(0)) - div_(Double(1), pack.number(law, 3 * s)) * x);
  }

  template <int kRows>
  STICTION_HD void aim_cone(Index s, Index row) const {
    const auto& law = pack.workspace.law;
    const Double normal = div_(Double(1), pack.number(law, 3 * s));
    const Double tangential = div_(Double(1), pack.number(law, 3 * s + 1));
    Double square(0);
    Double length(0);
    for (int k = 1; k < kRows; ++k) {
      const Double mu = pack.number(pack.workspace.mu, row + k);
      const Double x = unit_reaction(reaction(row + k), mu);
      const Double z = mu * motion(row + k) - tangential * x;
      square = fma_(x, x, square);
      length = fma_(z, z, length);
    }
    length = sqrt_(length);
    square = sqrt_(square);
    const Double x_n = reaction(row);
    const auto is_open = not_(x_n > Double(0));
    const auto sticks = and_(not_(is_open), square < Double(kInsideCone) * x_n);
    // Per unit of the scaled reaction: R where it sticks, its slip where it slides.
    const Double size = select(sticks, tangential, div_(length, select(square > Double(0), square, Double(1))));
    const Double moves = motion(row);
    for (int k = 1; k < kRows; ++k) {
      const Double mu = pack.number(pack.workspace.mu, row + k);
      const auto has_friction = mu > Double(0);
      const Double held = Double(0) - div_(size * reaction(row + k), select(has_friction, mu * mu, Double(1)));
      put(row + k, select(is_open, motion(row + k), select(has_friction, held, Double(0))));
    }
    const Double slid = length - (normal + tangential) * x_n;
    put(row, select(is_open, max_(moves, length), select(sticks, Double(0) - normal * x_n, slid)));
  }
};

}  // namespace stiction::inline STICTION_ISA
