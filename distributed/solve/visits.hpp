#pragma once

#include <span>
#include <vector>

#include "core/plan/body_plan.hpp"

namespace stiction::distributed {

/// Colours of the contacts of an environment, by position.
std::vector<Index> colors_by_position(const BodyPlanData& plan, Offset env);

/// A body's contacts of one colour, which are one vertex.
struct Visit {
  Index color;
  int other;  ///< owner of the other side; the body's own where there is none
};

/// tell(round) for each round in which the ghost that rank `ghost` has of a body is sent. The other rank visits some
/// of the body's contacts. Before it visits one, it needs the changes of the body by other contacts since. `visits`:
/// all of the body's, in order of colour.
template <class F>
void for_each_round(std::span<const Visit> visits, int ghost, Index colors, F&& tell) {
  bool is_stale = false;
  for (const Visit& visit : visits) {
    const bool is_known = visit.other == ghost;
    if (is_known && is_stale) tell(visit.color);
    is_stale = !is_known;
  }
  if (is_stale) tell(colors);
  tell(colors + 1);
}

}  // namespace stiction::distributed
