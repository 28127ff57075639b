#pragma once

#include "core/algorithm/velocity/evaluate/newton_progress.hpp"
#include "core/algorithm/velocity/iterate/slip_mixing.hpp"
#include "core/algorithm/velocity/lanes/velocity_workspace.hpp"

namespace stiction::inline STICTION_ISA {

/// Shifts of the rows' motions: de Saxce's terms, and the terms of the proximal centre.
template <class Types>
struct ShiftTerms {
  using Number = typename Types::Number;
  const VelocityWorkspace<Types>& workspace;
  const SlotOf<Types>* slots;
  const SlotCounts& counts;
  Law law;

  /// ||mu w_t|| of a slot.
  [[nodiscard]] STICTION_HD double slip_of(const SlotOf<Types>& slot, int l) const {
    double square = 0.0;
    for (Index k = 1; k < slot.rows; ++k) {
      const double slip = static_cast<double>(workspace.mu.at(slot.row + k, l)) *
                          workspace.motion[Offset{slot.row + k} * Types::kStride + l];
      square = fma_(slip, slip, square);
    }
    return sqrt_(square);
  }

  /// De Saxce's term and the proximal one, from the reactions and motions of the last evaluation.
  STICTION_HD_OUTLINE void renew(int l, LaneProgress& lane) const {
    const Index singles = counts.singles;  // which do not slip
    SlipMixing mixing{workspace.slip + l, counts.slots - singles, Types::kStride, lane.mixed};
    SlipMixing::Weights weights{0.0, 0.0};
    const bool slips = law == Law::coulomb;
    if (slips) {
      workspace.each(counts.slots - singles, [&](Index cone) {
        const SlotOf<Types>& slot = slots[singles + cone];
        mixing.age(cone);
        const double used = static_cast<double>(workspace.shift.at(slot.row, l)) + held(slot.row, l);
        mixing.image(0, cone) = slip_of(slot, l);
        mixing.change(0, cone) = mixing.image(0, cone) - used;
      });
      weights = mixing.weights();
      lane.mixed = lane.mixed < 2 ? lane.mixed + 1 : 2;
    }
    workspace.each(counts.slots, [&](Index s) {
      const SlotOf<Types>& slot = slots[s];
      for (Index k = 0; k < slot.rows; ++k) {
        const double slip = slips && k == 0 && slot.rows > 1 ? mixing.next(weights, s - singles) : 0.0;
        workspace.prox_center.at(slot.row + k, l) = workspace.x.at(slot.row + k, l);
        workspace.shift.at(slot.row + k, l) = static_cast<Number>(slip - held(slot.row + k, l));
      }
    });
  }

  /// Returns the term that the proximal term of a row subtracts.
  [[nodiscard]] STICTION_HD double held(Index row, int l) const {
    return static_cast<double>(workspace.prox.at(row, l)) * static_cast<double>(workspace.prox_center.at(row, l));
  }
};

}  // namespace stiction::inline STICTION_ISA
