#include "distributed/newton/domains.hpp"

#include <algorithm>

#include "core/base/extents.hpp"
#include "core/plan/block_tables.hpp"

namespace stiction::distributed {

namespace {

std::span<const Index> neighbours(const BlockPattern& pattern, Index body) {
  return {pattern.columns + pattern.offsets[body], pattern.columns + pattern.offsets[body + 1]};
}

/// The body whose subdomain a contact is of: a if it is pushed, else b; where neither is, one that is there; or none.
Index home_body(Index a, Index b, Index bodies) {
  for (const Index side : {a, b})
    if (side >= 0) return side;
  for (const Index side : {a, b})
    if (~side < bodies) return ~side;
  return -1;
}

void extend(Domains& made, const BlockPattern& pattern, bool overlap) {
  made.extended = made.bodies;
  if (overlap)
    for (std::vector<Index>& bodies : made.extended) {
      const std::size_t own = bodies.size();
      for (std::size_t k = 0; k < own; ++k)
        for (const Index other : neighbours(pattern, bodies[k])) bodies.push_back(other);
      std::sort(bodies.begin(), bodies.end());
      bodies.erase(std::unique(bodies.begin(), bodies.end()), bodies.end());
    }
  made.holders.resize(made.part.size());
  for (int domain = 0; domain < made.count(); ++domain)
    for (const Index body : made.extended[at(domain)]) made.holders[at(body)].push_back(domain);
}

/// Halves the bodies of each subdomain that touch others until they are groups of about kAggregateBodies.
void gather_aggregates(Domains& made, const BlockPattern& pattern, std::span<const Point> points) {
  made.aggregate.assign(made.part.size(), -1);
  for (const std::vector<Index>& own : made.bodies) {
    std::vector<Index> bodies;
    std::vector<Point> places;
    for (const Index body : own)
      if (neighbours(pattern, body).size() > 1) {
        bodies.push_back(body);
        places.push_back(points[at(body)]);
      }
    const auto groups = static_cast<int>((bodies.size() + kAggregateBodies - 1) / kAggregateBodies);
    if (groups == 0) continue;
    const std::vector<int> group = bisect(places, groups);
    const auto first = made.aggregates();
    made.members.resize(at(first + groups));
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      made.aggregate[at(bodies[k])] = first + group[k];
      made.members[at(first + group[k])].push_back(bodies[k]);
    }
    for (Index which = first; which < first + groups; ++which) made.root.push_back(made.members[at(which)].front());
  }
}

void couple_aggregates(Domains& made, const BlockPattern& pattern) {
  std::vector<Index> offsets{0}, columns;
  for (Index which = 0; which < made.aggregates(); ++which) {
    std::vector<Index> row;
    for (const Index body : made.members[at(which)])
      for (const Index other : neighbours(pattern, body)) row.push_back(made.aggregate[at(other)]);
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    columns.insert(columns.end(), row.begin(), row.end());
    offsets.push_back(static_cast<Index>(columns.size()));
  }
  append_pattern(made.coarse, made.aggregates(), offsets, columns);
}

}  // namespace

int Domains::home_of(Index which) const {
  return part[at(root[at(which)])];
}

BlockPattern Domains::coarse_pattern() const {
  const Index* next = coarse.data();
  return take_pattern(next);
}

Domains make_domains(const BlockPattern& pattern, const Index* sides, Index contacts, std::span<const int> part,
                     std::span<const Point> points, const DomainOptions& options) {
  Domains made;
  made.part.assign(part.begin(), part.end());
  made.bodies.resize(at(options.count));
  made.contacts.resize(at(options.count));
  for (Index body = 0; body < pattern.rows; ++body) made.bodies[at(part[at(body)])].push_back(body);
  for (Index p = 0; p < contacts; ++p) {
    const Index home = home_body(sides[2 * Offset{p}], sides[2 * Offset{p} + 1], pattern.rows);
    made.contacts[home < 0 ? 0 : at(part[at(home)])].push_back(p);
  }
  extend(made, pattern, options.overlap);
  if (options.is_coarse) gather_aggregates(made, pattern, points);
  couple_aggregates(made, pattern);
  return made;
}

}  // namespace stiction::distributed
