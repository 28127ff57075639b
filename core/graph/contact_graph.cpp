#include "stiction/contact_graph.hpp"

#include <algorithm>
#include <limits>
#include <string>
#include <utility>

#include "core/base/fp_env.hpp"
#include "core/graph/body_graph.hpp"
#include "core/graph/conflict_colors.hpp"
#include "core/graph/islands.hpp"
#include "stiction/error.hpp"

namespace stiction {

using graph::at;
using graph::BodyGraph;
using graph::Manifold;

namespace {

[[noreturn]] void fail(const std::string& message) {
  throw Error(ErrorCode::invalid_argument, message);
}

std::string name_of(Index body) {
  return body == kWorldBody ? "the world" : "body " + std::to_string(body);
}

void check_new_body(const BodyGraph& graph, Index body) {
  if (body < 0 || body == std::numeric_limits<Index>::max())
    fail("body = " + std::to_string(body) + ": indices are 0 .. 2147483646 (the world, -1, is always there)");
  if (graph.present(body)) fail("body = " + std::to_string(body) + ": is in the graph already; remove it first");
}

void check_present(const BodyGraph& graph, Index body) {
  if (!graph.present(body)) fail("body = " + std::to_string(body) + ": is not in the graph; add it first");
}

void check_bodies(const BodyGraph& graph, const GraphContact& contact) {
  const auto where = [&] { return "contact " + std::to_string(contact.id) + ": "; };
  for (const Index body : {contact.body_a, contact.body_b}) {
    if (!graph.present(body)) fail(where() + name_of(body) + " is not in the graph; add it first");
  }
  if (contact.body_a == contact.body_b) fail(where() + name_of(contact.body_a) + " touches itself; name two bodies");
  if (!graph.moves(contact.body_a) && !graph.moves(contact.body_b))
    fail(where() + name_of(contact.body_a) + " and " + name_of(contact.body_b) + " both never move; leave it out");
}

double ratio(Offset part, Offset whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

struct ContactGraph::State {
  struct Held {
    GraphContact contact;
    Index manifold = -1;  ///< -1: the slot is free
    Index place = -1;     ///< position among the manifold's contacts
    std::uint64_t seen = 0;
  };

  BodyGraph graph;
  graph::Islands islands;
  graph::ConflictColors colors;
  graph::Slots<Held> held;
  std::unordered_map<std::uint64_t, Index> slot_of_id;
  std::uint64_t step = 0;

  [[nodiscard]] Index slot(std::uint64_t id) const {
    const auto found = slot_of_id.find(id);
    return found == slot_of_id.end() ? -1 : found->second;
  }

  [[nodiscard]] Index present_slot(std::uint64_t id) const {
    const Index found = slot(id);
    if (found < 0) fail("contact " + std::to_string(id) + ": is not in the graph");
    return found;
  }

  [[nodiscard]] bool is_pair(Index held_slot, const GraphContact& contact) const {
    const GraphContact& before = held[held_slot].contact;
    return graph::pair_key(before.body_a, before.body_b) == graph::pair_key(contact.body_a, contact.body_b);
  }

  /// The contact as a new one, also where its id is held by another slot, which is then to be let go of.
  void take(const GraphContact& contact) {
    Index manifold = graph.find(contact.body_a, contact.body_b);
    if (manifold < 0) {
      manifold = graph.add_manifold(contact.body_a, contact.body_b);
      colors.manifold_added(manifold);
      if (graph.is_edge(graph.manifold(manifold))) islands.edge_added(graph.manifold(manifold));
    }
    Manifold& m = graph.manifold(manifold);
    const Index added = held.add({contact, manifold, static_cast<Index>(m.contacts.size()), step});
    m.contacts.push_back(added);
    islands.count_contacts(graph, m, 1);
    slot_of_id[contact.id] = added;
  }

  /// Lets go of slots. After as many followed edges as a rebuild of all islands takes, they are left to that.
  void drop(std::span<const Index> gone, GraphChange& change) {
    const Offset search_limit = graph.moving_count() + graph.manifold_count();
    for (const Index slot_gone : gone) drop(slot_gone, change, search_limit);
    if (change.searched_edges <= search_limit) return;
    islands.rebuild(graph);
    change.rebuilt_islands = 1;
  }

  void drop(Index gone, GraphChange& change, Offset search_limit) {
    const Held last_words = held[gone];
    const auto found = slot_of_id.find(last_words.contact.id);
    if (found->second == gone) slot_of_id.erase(found);
    Manifold& m = graph.manifold(last_words.manifold);
    islands.count_contacts(graph, m, -1);
    const Index last = m.contacts.back();
    held[last].place = last_words.place;
    m.contacts[at(last_words.place)] = last;
    m.contacts.pop_back();
    held.remove(gone);
    if (!m.contacts.empty()) return;
    const std::array<Index, 2> body = m.body;
    const bool edge = graph.is_edge(m);
    colors.manifold_removed(graph, last_words.manifold);
    graph.remove_manifold(last_words.manifold);
    if (edge && change.searched_edges <= search_limit)
      change.searched_edges += islands.edge_removed(graph, body[0], body[1]);
  }

  [[nodiscard]] GraphManifold describe(Index manifold) const {
    const Manifold& m = graph.manifold(manifold);
    return {m.body[0], m.body[1], static_cast<Index>(m.contacts.size()), colors.color(manifold)};
  }
};

ContactGraph::ContactGraph() : state_(std::make_unique<State>()) {}
ContactGraph::ContactGraph(const ContactGraph& other) : state_(std::make_unique<State>(*other.state_)) {}
ContactGraph::ContactGraph(ContactGraph&& other) noexcept = default;
ContactGraph& ContactGraph::operator=(const ContactGraph& other) {
  if (this != &other) state_ = std::make_unique<State>(*other.state_);
  return *this;
}
ContactGraph& ContactGraph::operator=(ContactGraph&& other) noexcept = default;
ContactGraph::~ContactGraph() = default;

void ContactGraph::add_body(Index body, BodyRole role) {
  check_new_body(state_->graph, body);
  state_->graph.add_body(body, role == BodyRole::moving);
  if (role == BodyRole::moving) state_->islands.body_added(body);
}

GraphChange ContactGraph::remove_body(Index body) {
  State& s = *state_;
  check_present(s.graph, body);
  if (body == kWorldBody) fail("body = -1: the world stays");
  GraphChange change;
  std::vector<Index> gone;
  for (const Index slot : s.graph.body(body).manifolds) {
    const std::vector<Index>& contacts = s.graph.manifold(slot).contacts;
    gone.insert(gone.end(), contacts.begin(), contacts.end());
  }
  change.removed = static_cast<Offset>(gone.size());
  s.drop(gone, change);
  if (s.graph.moves(body)) s.islands.body_removed(body);
  s.graph.remove_body(body);
  s.colors.settle(s.graph, change);
  return change;
}

GraphChange ContactGraph::add_contact(const GraphContact& contact) {
  State& s = *state_;
  if (s.slot(contact.id) >= 0) fail("contact " + std::to_string(contact.id) + ": is in the graph already; update it");
  check_bodies(s.graph, contact);
  GraphChange change;
  change.added = 1;
  s.take(contact);
  s.colors.settle(s.graph, change);
  return change;
}

GraphChange ContactGraph::remove_contact(std::uint64_t id) {
  State& s = *state_;
  const Index gone = s.present_slot(id);
  GraphChange change;
  change.removed = 1;
  s.drop({&gone, 1}, change);
  s.colors.settle(s.graph, change);
  return change;
}

GraphChange ContactGraph::update_contact(const GraphContact& contact) {
  State& s = *state_;
  const Index before = s.present_slot(contact.id);
  check_bodies(s.graph, contact);
  GraphChange change;
  if (s.is_pair(before, contact)) {
    s.held[before].contact = contact;
    return change;
  }
  change.moved = 1;
  s.take(contact);
  s.drop({&before, 1}, change);
  s.colors.settle(s.graph, change);
  return change;
}

GraphChange ContactGraph::update(std::span<const GraphContact> contacts) {
  State& s = *state_;
  GraphChange change;
  std::vector<const GraphContact*> turned, fresh;
  std::vector<Index> gone;  // slots that moved, then slots that vanished
  const auto fail_twice = [](std::uint64_t id) { fail("contact " + std::to_string(id) + ": is in the list twice"); };
  ++s.step;
  for (const GraphContact& contact : contacts) {
    check_bodies(s.graph, contact);
    const Index slot = s.slot(contact.id);
    if (slot < 0) {
      fresh.push_back(&contact);
      continue;
    }
    if (s.held[slot].seen == s.step) fail_twice(contact.id);
    s.held[slot].seen = s.step;
    if (!s.is_pair(slot, contact)) {
      fresh.push_back(&contact);
      gone.push_back(slot);
    } else {
      ++change.kept;
      if (!(s.held[slot].contact == contact)) turned.push_back(&contact);
    }
  }
  std::sort(fresh.begin(), fresh.end(), [](const auto* a, const auto* b) { return a->id < b->id; });
  for (std::size_t i = 1; i < fresh.size(); ++i) {
    if (fresh[i - 1]->id == fresh[i]->id) fail_twice(fresh[i]->id);
  }

  change.moved = static_cast<Offset>(gone.size());
  change.added = static_cast<Offset>(fresh.size()) - change.moved;
  change.removed = s.held.count() - change.kept - change.moved;
  for (Index slot = 0; slot < s.held.end() && change.removed > 0; ++slot) {
    if (s.held[slot].manifold >= 0 && s.held[slot].seen != s.step) gone.push_back(slot);
  }
  for (const GraphContact* contact : turned) s.held[s.slot(contact->id)].contact = *contact;
  for (const GraphContact* contact : fresh) s.take(*contact);
  s.drop(gone, change);
  s.colors.settle(s.graph, change);
  return change;
}

void ContactGraph::rebuild() {
  state_->islands.rebuild(state_->graph);
  state_->colors.rebuild(state_->graph);
}

bool ContactGraph::has_body(Index body) const noexcept {
  return state_->graph.present(body);
}

bool ContactGraph::has_contact(std::uint64_t id) const noexcept {
  return state_->slot(id) >= 0;
}

BodyRole ContactGraph::role(Index body) const {
  check_present(state_->graph, body);
  return state_->graph.moves(body) ? BodyRole::moving : BodyRole::fixed;
}

GraphContact ContactGraph::contact(std::uint64_t id) const {
  return state_->held[state_->present_slot(id)].contact;
}

Index ContactGraph::color(std::uint64_t id) const {
  return state_->colors.color(state_->held[state_->present_slot(id)].manifold);
}

Index ContactGraph::contact_count(Index body_a, Index body_b) const noexcept {
  const Index manifold = state_->graph.find(body_a, body_b);
  return manifold < 0 ? 0 : static_cast<Index>(state_->graph.manifold(manifold).contacts.size());
}

Index ContactGraph::degree(Index body) const {
  check_present(state_->graph, body);
  if (body == kWorldBody) fail("body = -1: the contacts of the world are not listed");
  const graph::Body& found = state_->graph.body(body);
  return found.moves ? found.degree : static_cast<Index>(found.manifolds.size());
}

Index ContactGraph::island(Index body) const {
  check_present(state_->graph, body);
  if (!state_->graph.moves(body)) return -1;
  return *state_->islands.islands()[state_->islands.slot(body)].bodies.begin();
}

GraphStatistics ContactGraph::statistics() const {
  const ScopedFpEnv fp_env;
  const State& s = *state_;
  GraphStatistics stats;
  stats.moving_count = s.graph.moving_count();
  stats.fixed_count = s.graph.fixed_count();
  stats.contact_count = s.held.count();
  stats.manifold_count = s.graph.manifold_count();
  stats.edge_count = s.graph.edge_count();
  stats.mean_degree = ratio(2 * stats.edge_count, stats.moving_count);
  stats.density = ratio(2 * stats.edge_count, stats.moving_count * stats.moving_count);
  stats.min_degree = static_cast<Index>(s.graph.degrees().least(0));
  stats.max_degree = static_cast<Index>(s.graph.degrees().most(0));
  stats.island_count = s.islands.islands().count();
  stats.largest_island = s.islands.sizes().most(0);
  stats.mean_contacts_per_island = ratio(stats.contact_count, stats.island_count);
  stats.max_contacts_per_island = s.islands.contacts().most(0);
  stats.color_count = s.colors.color_count();
  return stats;
}

std::vector<Index> ContactGraph::bodies() const {
  std::vector<Index> present;
  for (Index body = 0; body < state_->graph.body_end(); ++body) {
    if (state_->graph.present(body)) present.push_back(body);
  }
  return present;
}

std::vector<GraphContact> ContactGraph::contacts() const {
  std::vector<GraphContact> present;
  for (Index slot = 0; slot < state_->held.end(); ++slot) {
    if (state_->held[slot].manifold >= 0) present.push_back(state_->held[slot].contact);
  }
  std::sort(present.begin(), present.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  return present;
}

std::vector<GraphManifold> ContactGraph::manifolds() const {
  std::vector<GraphManifold> present;
  for (Index slot = 0; slot < state_->graph.manifold_end(); ++slot) {
    if (!state_->graph.manifold(slot).contacts.empty()) present.push_back(state_->describe(slot));
  }
  std::sort(present.begin(), present.end(),
            [](const auto& a, const auto& b) { return std::pair(a.body_a, a.body_b) < std::pair(b.body_a, b.body_b); });
  return present;
}

std::vector<GraphIsland> ContactGraph::islands() const {
  const graph::Slots<graph::Island>& all = state_->islands.islands();
  std::vector<GraphIsland> present;
  for (Index slot = 0; slot < all.end(); ++slot) {
    if (all[slot].bodies.empty()) continue;
    present.push_back({{all[slot].bodies.begin(), all[slot].bodies.end()}, all[slot].contact_count});
  }
  std::sort(present.begin(), present.end(),
            [](const auto& a, const auto& b) { return a.bodies.front() < b.bodies.front(); });
  return present;
}

}  // namespace stiction
