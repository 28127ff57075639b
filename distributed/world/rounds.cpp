#include "distributed/world/rounds.hpp"

#include <algorithm>

#include "distributed/solve/visits.hpp"
#include "distributed/transport/letters.hpp"

namespace stiction::distributed {

namespace {

std::size_t at(Index place) {
  return static_cast<std::size_t>(place);
}

/// A ghost's twist is sent in a round.
struct Notice {
  Index round, body;  ///< the world's number
};

}  // namespace

Rounds make_rounds(Transport& transport, const PieceBodies& bodies, const BodyPlanData& plan) {
  const std::vector<Index> colors = colors_by_position(plan, 0);
  const Index color_count = plan.color_count.front();
  Rounds rounds(at(color_count) + 2);
  std::vector<int> ranks;
  std::vector<Letter> letters;
  const auto letter_to = [&](int rank) -> Letter& {
    const auto place = static_cast<std::size_t>(std::lower_bound(ranks.begin(), ranks.end(), rank) - ranks.begin());
    if (place == ranks.size() || ranks[place] != rank) {
      ranks.insert(ranks.begin() + static_cast<std::ptrdiff_t>(place), rank);
      letters.emplace(letters.begin() + static_cast<std::ptrdiff_t>(place));
    }
    return letters[place];
  };
  std::vector<Visit> visits;
  std::vector<int> others;
  for (Index body = 0; body < static_cast<Index>(bodies.body.size()); ++body) {
    if (!bodies.owns(body)) continue;
    visits.clear();
    others.clear();
    for (Index k = plan.body_offsets[at(body)]; k < plan.body_offsets[at(body) + 1]; ++k) {
      const Index entry = plan.body_contacts[at(k)];
      const Index p = entry >= 0 ? entry : ~entry;
      // The other side of a contact whose body is b, or a, by `entry`.
      const Index side = plan.sides[2 * at(p) + (entry >= 0 ? 0 : 1)];
      const int other = side >= 0 ? bodies.owner[at(side)] : bodies.rank;
      if (visits.empty() || visits.back().color != colors[at(p)]) visits.push_back({colors[at(p)], other});
      if (other != bodies.rank) others.push_back(other);
    }
    std::sort(others.begin(), others.end());
    others.erase(std::unique(others.begin(), others.end()), others.end());
    for (const int ghost : others)
      for_each_round(visits, ghost, color_count, [&](Index round) {
        neighbour_of(rounds[at(round)], ghost).send.push_back(body);
        letter_to(ghost).put(Notice{round, bodies.body[at(body)]});
      });
  }
  std::vector<Letter> notices = exchange_with(transport, ranks, letters);
  for (std::size_t k = 0; k < notices.size(); ++k)
    while (!notices[k].at_end()) {
      const auto [round, body] = notices[k].take<Notice>();
      const auto local = std::lower_bound(bodies.body.begin(), bodies.body.end(), body) - bodies.body.begin();
      neighbour_of(rounds[at(round)], ranks[k]).receive.push_back(static_cast<Index>(local));
    }
  return rounds;
}

}  // namespace stiction::distributed
