#pragma once

#include "core/algorithm/rigid/sequential_impulses.hpp"

/// Sequential impulses over several memories (docs/howto/ranks.md): where the phases of a team of ranks differ from
/// those of a team of lanes. Everything else, formulas and order, is sequential_impulses.hpp's.
///
/// Each rank has a piece of an environment. It holds the bodies that the rank owns and every contact that pushes one of
/// them. The other bodies of those contacts are its ghosts. A contact between two ranks' bodies is visited by both,
/// from the same twists, so both find the same impulse. A rank thus knows all impulses on its own bodies. It needs the
/// twists of ghosts, when contacts that it does not visit have moved them.
namespace stiction::inline STICTION_ISA {

/// A team of one lane that is one of several ranks. max() and combine() are over the ranks, like those over lanes.
///
///   share(round, rows, width)   fetches the first six numbers of those rows (`width` apart) from the ranks that own
///                               them. Round c is of ghosts that contacts of colour c read, round color_count of those
///                               that have moved since. Round color_count + 1 is of all ghosts
template <class B>
concept RankedTeam =
    Team<B> && requires(B& team, Index round, double* rows, Index width) { team.share(round, rows, width); };

/// Twists of all ghosts.
template <RankedTeam TeamT, class Real>
STICTION_HD void share_ghosts(TeamT& team, Index color_count, const Strided<Real, 1>& rows, Index width) {
  team.share(color_count + 1, rows.data, width);
}

/// Makes one sweep: each colour is a sweep of that colour alone, from twists that are those of their owners. Twists of
/// all ghosts are their owners' when it ends.
template <RankedTeam TeamT, class Env, class System>
STICTION_HD auto sweep_bodies(TeamT& team, const Env& env, const System& s, typename System::Real omega) {
  SerialTeam alone;
  typename System::Real largest(0);
  Env one_color = env;
  one_color.color_count = 1;
  for (Index color = 0; color < env.color_count; ++color) {
    team.share(color, s.motion.data, System::kTwistRow);
    one_color.color_offsets = env.color_offsets + color;
    largest = max_(sweep_bodies(alone, one_color, s, omega), largest);
  }
  team.share(env.color_count, s.motion.data, System::kTwistRow);
  return largest;
}

/// Scales of ghosts from their owners; whether any grew on any rank, so that all spread once more.
template <RankedTeam TeamT, class Real, Law kLaw>
STICTION_HD bool share_scales(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, 1>&,
                              const Strided<double, 1>& reach, bool has_grown) {
  share_ghosts(team, env.color_count, reach, 6);
  return team.max(has_grown ? 1.0 : 0.0) > 0.0;
}

/// Recomputes twists of a rank's own bodies. A ghost has contacts that the rank does not know.
template <RankedTeam TeamT, class Real, Law kLaw>
STICTION_HD void refresh_bodies(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, 1>& s,
                                const SiParams& params) {
  SerialTeam alone;
  refresh_bodies(alone, env, s, params);
  share_ghosts(team, env.color_count, s.motion, s.kTwistRow);
  if (s.has_momentum()) share_ghosts(team, env.color_count, s.motion_before, s.kTwistRow);
}

/// Twists of a rank's own bodies under the impulses that are returned, into s.exact; those of ghosts from their owners.
template <RankedTeam TeamT, class Real, Law kLaw>
STICTION_HD void gather_exact(TeamT& team, const BodyEnv<Real>& env, const BodySystem<Real, kLaw, 1>& s,
                              const ContactTiles<Real, 1>& x, const SiParams& params) {
  SerialTeam alone;
  gather_exact(alone, env, s, x, params);
  share_ghosts(team, env.color_count, s.exact, 6);
}

}  // namespace stiction::inline STICTION_ISA
