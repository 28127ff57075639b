#include "distributed/newton/reach.hpp"

#include <algorithm>

#include "core/base/extents.hpp"
#include "core/plan/block_tables.hpp"

namespace stiction::distributed {

namespace {

void sort_once(std::vector<Index>& numbers) {
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
}

std::vector<Index> with_neighbours(const BlockPattern& pattern, std::vector<Index> bodies) {
  const std::size_t own = bodies.size();
  for (std::size_t k = 0; k < own; ++k)
    bodies.insert(bodies.end(), pattern.columns + pattern.offsets[bodies[k]],
                  pattern.columns + pattern.offsets[bodies[k] + 1]);
  sort_once(bodies);
  return bodies;
}

/// Domains, rows and seen of a rank, which every other rank has to know.
Reach bodies_of(const BlockPattern& pattern, const Domains& domains, std::span<const int> home, int rank) {
  Reach reach;
  std::vector<Index> own;
  for (int domain = 0; domain < domains.count(); ++domain) {
    if (home[at(domain)] != rank) continue;
    reach.domains.push_back(domain);
    const std::vector<Index>& bodies = domains.bodies[at(domain)];
    own.insert(own.end(), bodies.begin(), bodies.end());
  }
  reach.rows = with_neighbours(pattern, own);
  reach.seen = with_neighbours(pattern, reach.rows);
  return reach;
}

void find_contacts(Reach& reach, const NewtonStream& stream, const Domains& domains) {
  for (const Index row : reach.rows) {
    const Index block = find_block(stream.pattern, row, row);
    for (Index k = stream.block_offsets[block]; k < stream.block_offsets[block + 1]; ++k) {
      const Index entry = stream.block_contacts[k];
      reach.contacts.push_back(entry >= 0 ? entry : ~entry);
    }
  }
  for (const int domain : reach.domains) {
    const std::vector<Index>& own = domains.contacts[at(domain)];
    reach.contacts.insert(reach.contacts.end(), own.begin(), own.end());
  }
  sort_once(reach.contacts);
}

void number_slots(Reach& reach, const Domains& domains) {
  reach.slot_offsets.assign(1, 0);
  std::vector<Index> first(domains.part.size(), -1);
  for (const Index body : reach.seen) {
    const std::vector<int>& holders = domains.holders[at(body)];
    first[at(body)] = reach.slot_count();
    reach.slots.insert(reach.slots.end(), holders.begin(), holders.end());
    reach.slot_offsets.push_back(reach.slot_count());
  }
  for (const int domain : reach.domains) {
    std::vector<Index>& slots = reach.own_slots.emplace_back();
    for (const Index body : domains.extended[at(domain)]) {
      Index slot = first[at(body)];
      while (reach.slots[at(slot)] != domain) ++slot;
      slots.push_back(slot);
    }
  }
}

/// f(slot) for each slot of this rank that is a body the other sees, and from a subdomain of `from`.
template <class F>
void for_each_shared(const Reach& reach, const std::vector<Index>& seen, std::span<const int> home, int from, F&& f) {
  auto other = seen.begin();
  for (std::size_t k = 0; k < reach.seen.size(); ++k) {
    while (other != seen.end() && *other < reach.seen[k]) ++other;
    if (other == seen.end() || *other != reach.seen[k]) continue;
    for (Index slot = reach.slot_offsets[k]; slot < reach.slot_offsets[k + 1]; ++slot)
      if (home[at(reach.slots[at(slot)])] == from) f(slot);
  }
}

void add_round(Rounds& rounds, Neighbour neighbour, std::size_t round) {
  if (!neighbour.send.empty() || !neighbour.receive.empty()) rounds[round].push_back(std::move(neighbour));
}

}  // namespace

Reach make_reach(const NewtonStream& stream, const Domains& domains, std::span<const int> home, int rank, int ranks) {
  Reach reach = bodies_of(stream.pattern, domains, home, rank);
  find_contacts(reach, stream, domains);
  number_slots(reach, domains);
  const auto rank_of = [&](Index aggregate) { return home[at(domains.home_of(aggregate))]; };
  for (Index which = 0; which < domains.aggregates(); ++which)
    if (rank_of(which) == rank) reach.aggregates.push_back(which);
  const BlockPattern coarse = domains.coarse_pattern();
  reach.rounds.resize(2);
  for (int other = 0; other < ranks; ++other) {
    if (other == rank) continue;
    const std::vector<Index> seen = bodies_of(stream.pattern, domains, home, other).seen;
    Neighbour corrections{other, {}, {}}, blocks{other, {}, {}};
    for_each_shared(reach, seen, home, rank, [&](Index slot) { corrections.send.push_back(slot); });
    // A body is sent where the other sees it, and received where this rank does: all that it has slots for.
    for_each_shared(reach, reach.seen, home, other, [&](Index slot) { corrections.receive.push_back(slot); });
    for (Index which = 0; which < domains.aggregates(); ++which) {
      const int from = rank_of(which);
      if (from != rank && from != other) continue;
      (from == rank ? corrections.send : corrections.receive).push_back(reach.slot_count() + which);
      for (Index k = coarse.offsets[which]; k < coarse.offsets[which + 1] && coarse.columns[k] <= which; ++k)
        for (Index row = 0; row < kBodyBlock; ++row)
          (from == rank ? blocks.send : blocks.receive).push_back(kBodyBlock * k + row);
    }
    add_round(reach.rounds, std::move(corrections), 0);
    add_round(reach.rounds, std::move(blocks), 1);
  }
  return reach;
}

}  // namespace stiction::distributed
