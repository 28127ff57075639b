#include "core/graph/islands.hpp"

#include <utility>

namespace stiction::graph {
namespace {

/// A mark that no search has.
constexpr std::uint64_t kNobody = ~std::uint64_t{0};

Offset owned_contacts(const BodyGraph& graph, Index body) {
  Offset count = 0;
  for (const Index slot : graph.body(body).manifolds) {
    const Manifold& m = graph.manifold(slot);
    if (graph.owner(m) == body) count += static_cast<Offset>(m.contacts.size());
  }
  return count;
}

}  // namespace

Index Islands::add_island(Island island) {
  sizes_.add(static_cast<Offset>(island.bodies.size()));
  contacts_.add(island.contact_count);
  const Index slot = islands_.add(std::move(island));
  for (const Index body : islands_[slot].bodies) slot_of_body_[at(body)] = slot;
  return slot;
}

void Islands::drop_island(Index slot) {
  sizes_.remove(static_cast<Offset>(islands_[slot].bodies.size()));
  contacts_.remove(islands_[slot].contact_count);
  islands_.remove(slot);
}

void Islands::body_added(Index body) {
  if (at(body) >= slot_of_body_.size()) {
    slot_of_body_.resize(at(body) + 1, -1);
    marks_.resize(at(body) + 1, 0);
  }
  add_island({{body}, 0});
}

void Islands::body_removed(Index body) {
  drop_island(slot(body));
  slot_of_body_[at(body)] = -1;
}

void Islands::edge_added(const Manifold& m) {
  if (slot(m.body[0]) != slot(m.body[1])) join(slot(m.body[0]), slot(m.body[1]));
}

/// The smaller moves into the larger, so a body moves at most log2 n times while islands only grow.
void Islands::join(Index a, Index b) {
  if (islands_[a].bodies.size() < islands_[b].bodies.size()) std::swap(a, b);
  for (const Index body : islands_[b].bodies) slot_of_body_[at(body)] = a;
  Island joined = std::move(islands_[b]);
  sizes_.remove(static_cast<Offset>(joined.bodies.size()));
  contacts_.remove(joined.contact_count);
  islands_.remove(b);
  Island& large = islands_[a];
  sizes_.replace(static_cast<Offset>(large.bodies.size()),
                 static_cast<Offset>(large.bodies.size() + joined.bodies.size()));
  contacts_.replace(large.contact_count, large.contact_count + joined.contact_count);
  large.bodies.merge(joined.bodies);
  large.contact_count += joined.contact_count;
}

void Islands::count_contacts(const BodyGraph& graph, const Manifold& m, Offset change) {
  Island& island = islands_[slot(graph.owner(m))];
  contacts_.replace(island.contact_count, island.contact_count + change);
  island.contact_count += change;
}

void Islands::start(Search& search, Index body) {
  search.bodies.assign(1, body);
  search.head = search.next = 0;
  search.mark = ++last_mark_;
  marks_[at(body)] = search.mark;
}

/// Follows one manifold.
Islands::Step Islands::advance(Search& search, std::uint64_t other_mark, const BodyGraph& graph) {
  while (search.next == graph.body(search.bodies[search.head]).manifolds.size()) {
    search.next = 0;
    if (++search.head == search.bodies.size()) return Step::exhausted;
  }
  const Index body = search.bodies[search.head];
  const Index other = BodyGraph::across(graph.manifold(graph.body(body).manifolds[search.next++]), body);
  if (!graph.moves(other)) return Step::searching;
  std::uint64_t& mark = marks_[at(other)];
  if (mark == other_mark) return Step::met;
  if (mark != search.mark) {
    mark = search.mark;
    search.bodies.push_back(other);
  }
  return Step::searching;
}

Offset Islands::edge_removed(const BodyGraph& graph, Index a, Index b) {
  start(searches_[0], a);
  start(searches_[1], b);
  for (Offset followed = 0;; ++followed) {
    Search& mine = searches_[at(followed % 2)];
    const Step step = advance(mine, searches_[at(1 - followed % 2)].mark, graph);
    if (step == Step::exhausted) split_off(graph, mine.bodies);
    if (step != Step::searching) return followed + 1;
  }
}

/// Gives the side whose search was exhausted, the cheaper one to search, a separate island.
void Islands::split_off(const BodyGraph& graph, const std::vector<Index>& bodies) {
  Island& rest = islands_[slot(bodies.front())];
  sizes_.remove(static_cast<Offset>(rest.bodies.size()));
  contacts_.remove(rest.contact_count);
  Island part;
  for (const Index body : bodies) {
    rest.bodies.erase(body);
    part.bodies.insert(body);
    part.contact_count += owned_contacts(graph, body);
  }
  rest.contact_count -= part.contact_count;
  sizes_.add(static_cast<Offset>(rest.bodies.size()));
  contacts_.add(rest.contact_count);
  add_island(std::move(part));
}

void Islands::rebuild(const BodyGraph& graph) {
  islands_.clear();
  sizes_.clear();
  contacts_.clear();
  slot_of_body_.assign(at(graph.body_end()), -1);
  marks_.assign(at(graph.body_end()), 0);
  Search& search = searches_[0];
  for (Index body = 0; body < graph.body_end(); ++body) {
    if (!graph.moves(body) || slot(body) >= 0) continue;
    start(search, body);
    while (advance(search, kNobody, graph) == Step::searching) continue;
    Island found;
    for (const Index reached : search.bodies) {
      found.bodies.insert(reached);
      found.contact_count += owned_contacts(graph, reached);
    }
    add_island(std::move(found));
  }
}

}  // namespace stiction::graph
