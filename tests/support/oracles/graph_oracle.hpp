#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "stiction/contact_graph.hpp"

/// A contact graph by brute force, and random changes of both.
namespace stiction::test {

using Pair = std::pair<Index, Index>;

inline Pair pair_of(const GraphContact& contact) {
  return std::minmax(contact.body_a, contact.body_b);
}

/// The page's formula for the priority of a pair, written down once more.
inline std::uint64_t priority(const Pair& pair) {
  std::uint64_t x = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(pair.first)) << 32) +
                    static_cast<std::uint32_t>(pair.second) + 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Present contacts, and everything derived by brute force from the definitions.
struct GraphOracle {
  std::map<Index, BodyRole> bodies;
  std::map<std::uint64_t, GraphContact> contacts;

  [[nodiscard]] bool moves(Index body) const { return body >= 0 && bodies.at(body) == BodyRole::moving; }

  [[nodiscard]] std::map<Pair, Index> weights() const {
    std::map<Pair, Index> found;
    for (const auto& [id, contact] : contacts) ++found[pair_of(contact)];
    return found;
  }

  /// Every moving body takes the smallest label in its neighbourhood until nothing changes.
  [[nodiscard]] std::map<Index, Index> labels() const {
    std::map<Index, Index> label;
    for (const auto& [body, role] : bodies) {
      if (role == BodyRole::moving) label[body] = body;
    }
    for (bool changed = true; changed;) {
      changed = false;
      for (const auto& [pair, count] : weights()) {
        if (!moves(pair.first) || !moves(pair.second)) continue;
        Index &a = label[pair.first], &b = label[pair.second];
        changed = changed || a != b;
        a = b = std::min(a, b);
      }
    }
    return label;
  }

  [[nodiscard]] bool conflict(const Pair& p, const Pair& q) const {
    for (const Index body : {p.first, p.second}) {
      if (moves(body) && (body == q.first || body == q.second)) return true;
    }
    return false;
  }

  [[nodiscard]] std::map<Pair, Index> colors() const {
    std::vector<Pair> order;
    for (const auto& [pair, count] : weights()) order.push_back(pair);
    std::sort(order.begin(), order.end(), [](const Pair& p, const Pair& q) { return priority(p) < priority(q); });
    std::map<Pair, Index> color;
    for (const Pair& pair : order) {
      std::set<Index> taken;
      for (const auto& [other, held] : color) {
        if (conflict(pair, other)) taken.insert(held);
      }
      Index smallest = 0;
      while (taken.count(smallest) != 0) ++smallest;
      color[pair] = smallest;
    }
    return color;
  }
};

inline void expect_equal(const ContactGraph& graph, const GraphOracle& oracle) {
  std::vector<Index> bodies;
  for (const auto& [body, role] : oracle.bodies) {
    bodies.push_back(body);
    ASSERT_EQ(graph.role(body), role);
  }
  ASSERT_EQ(graph.bodies(), bodies);
  std::vector<GraphContact> contacts;
  for (const auto& [id, contact] : oracle.contacts) contacts.push_back(contact);
  ASSERT_EQ(graph.contacts(), contacts);

  const auto weights = oracle.weights();
  const auto colors = oracle.colors();
  std::vector<GraphManifold> manifolds;
  for (const auto& [pair, count] : weights) manifolds.push_back({pair.first, pair.second, count, colors.at(pair)});
  ASSERT_EQ(graph.manifolds(), manifolds);
  for (const GraphContact& contact : contacts) ASSERT_EQ(graph.color(contact.id), colors.at(pair_of(contact)));

  std::map<Index, GraphIsland> islands;
  std::map<Index, Index> degree;
  GraphStatistics expected;
  for (const auto& [body, label] : oracle.labels()) {
    islands[label].bodies.push_back(body);
    degree[body] = 0;
    ASSERT_EQ(graph.island(body), label);
  }
  for (const auto& [pair, count] : weights) {
    const Index owner = oracle.moves(pair.first) ? pair.first : pair.second;
    islands[graph.island(owner)].contact_count += count;
    if (!oracle.moves(pair.first) || !oracle.moves(pair.second)) continue;
    ++expected.edge_count;
    ++degree[pair.first];
    ++degree[pair.second];
  }
  std::vector<GraphIsland> island_list;
  for (const auto& [label, island] : islands) {
    island_list.push_back(island);
    expected.largest_island = std::max<Offset>(expected.largest_island, static_cast<Offset>(island.bodies.size()));
    expected.max_contacts_per_island = std::max(expected.max_contacts_per_island, island.contact_count);
  }
  ASSERT_EQ(graph.islands(), island_list);

  const GraphStatistics stats = graph.statistics();
  const auto moving = static_cast<double>(degree.size());
  if (!degree.empty()) {
    const auto by_degree = [](const auto& a, const auto& b) { return a.second < b.second; };
    expected.min_degree = std::min_element(degree.begin(), degree.end(), by_degree)->second;
    expected.max_degree = std::max_element(degree.begin(), degree.end(), by_degree)->second;
    ASSERT_EQ(stats.mean_degree, static_cast<double>(2 * expected.edge_count) / moving);
    ASSERT_EQ(stats.density, static_cast<double>(2 * expected.edge_count) / (moving * moving));
    ASSERT_EQ(stats.mean_contacts_per_island,
              static_cast<double>(contacts.size()) / static_cast<double>(islands.size()));
  }
  for (const auto& [pair, color] : colors) expected.color_count = std::max(expected.color_count, color + 1);
  ASSERT_EQ(stats.moving_count, static_cast<Offset>(degree.size()));
  ASSERT_EQ(stats.fixed_count, static_cast<Offset>(bodies.size() - degree.size()));
  ASSERT_EQ(stats.contact_count, static_cast<Offset>(contacts.size()));
  ASSERT_EQ(stats.manifold_count, static_cast<Offset>(weights.size()));
  ASSERT_EQ(stats.edge_count, expected.edge_count);
  ASSERT_EQ(stats.min_degree, expected.min_degree);
  ASSERT_EQ(stats.max_degree, expected.max_degree);
  ASSERT_EQ(stats.island_count, static_cast<Offset>(islands.size()));
  ASSERT_EQ(stats.largest_island, expected.largest_island);
  ASSERT_EQ(stats.max_contacts_per_island, expected.max_contacts_per_island);
  ASSERT_EQ(stats.color_count, expected.color_count);
  for (const auto& [body, count] : degree) ASSERT_EQ(graph.degree(body), count);
}

/// Random changes of a graph and of the oracle, half of the bodies' indices unused.
class Changer {
 public:
  Changer(std::uint32_t seed, std::uint32_t body_range) : random_(seed), body_range_(body_range) {}
  ContactGraph graph;
  GraphOracle oracle;

  void change() {
    const std::uint32_t kind = below(30);
    if (kind == 0) {
      toggle_body();
    } else if (kind < 12) {
      add();
    } else if (kind < 18) {
      remove();
    } else if (kind < 21) {
      move();
    } else {
      update();
    }
  }

  void toggle_body() {
    const auto body = static_cast<Index>(below(body_range_));
    if (oracle.bodies.count(body) == 0) {
      const BodyRole role = below(6) == 0 ? BodyRole::fixed : BodyRole::moving;
      oracle.bodies[body] = role;
      graph.add_body(body, role);
      return;
    }
    const std::size_t before = oracle.contacts.size();
    std::erase_if(oracle.contacts,
                  [&](const auto& item) { return item.second.body_a == body || item.second.body_b == body; });
    oracle.bodies.erase(body);
    EXPECT_EQ(graph.remove_body(body).removed, static_cast<Offset>(before - oracle.contacts.size()));
  }

 private:
  std::uint32_t below(std::uint32_t end) { return static_cast<std::uint32_t>(random_() % end); }

  Index any_body() {
    if (oracle.bodies.empty() || below(8) == 0) return kWorldBody;
    return std::next(oracle.bodies.begin(), below(static_cast<std::uint32_t>(oracle.bodies.size())))->first;
  }

  /// Bodies of near index more often than not, so that islands form, break and have cycles. False: no such pair came.
  bool draw_pair(GraphContact& contact) {
    for (int attempt = 0; attempt < 20; ++attempt) {
      contact.body_a = any_body();
      contact.body_b = any_body();
      const bool far = std::abs(contact.body_a - contact.body_b) > 3 && contact.body_a >= 0 && contact.body_b >= 0;
      if ((far && below(4) != 0) || contact.body_a == contact.body_b) continue;
      if (oracle.moves(contact.body_a) || oracle.moves(contact.body_b)) return true;
    }
    return false;
  }

  GraphContact& any_contact() {
    return std::next(oracle.contacts.begin(), below(static_cast<std::uint32_t>(oracle.contacts.size())))->second;
  }

  void add() {
    GraphContact contact{next_id_++ * 0x10001, 0, 0};
    if (!draw_pair(contact)) return;
    oracle.contacts[contact.id] = contact;
    EXPECT_EQ(graph.add_contact(contact).added, 1);
  }

  void remove() {
    if (oracle.contacts.empty()) return;
    const std::uint64_t id = any_contact().id;
    oracle.contacts.erase(id);
    EXPECT_EQ(graph.remove_contact(id).removed, 1);
  }

  void move() {
    if (oracle.contacts.empty()) return;
    GraphContact& contact = any_contact();
    const Pair before = pair_of(contact);
    if (!draw_pair(contact)) return;
    EXPECT_EQ(graph.update_contact(contact).moved, before == pair_of(contact) ? 0 : 1);
  }

  /// A new step: some contacts vanish, some come, some move, in any order.
  void update() {
    const std::uint32_t share = below(20) == 0 ? 2 : 20 + below(60);
    GraphChange expected;
    std::map<std::uint64_t, GraphContact> next;
    for (auto [id, contact] : oracle.contacts) {
      if (below(share) == 0) {
        ++expected.removed;
        continue;
      }
      const Pair before = pair_of(contact);
      if (below(share) == 0) draw_valid(contact);
      if (below(3) == 0) std::swap(contact.body_a, contact.body_b);
      ++(before == pair_of(contact) ? expected.kept : expected.moved);
      next[id] = contact;
    }
    for (std::uint32_t k = below(10); k > 0; --k) {
      GraphContact contact{next_id_++ * 0x10001, 0, 0};
      if (!draw_pair(contact)) continue;
      next[contact.id] = contact;
      ++expected.added;
    }
    oracle.contacts = next;
    std::vector<GraphContact> list;
    for (const auto& [id, contact] : next) list.push_back(contact);
    std::shuffle(list.begin(), list.end(), random_);
    const GraphChange change = graph.update(list);
    EXPECT_EQ(change.added, expected.added);
    EXPECT_EQ(change.removed, expected.removed);
    EXPECT_EQ(change.moved, expected.moved);
    EXPECT_EQ(change.kept, expected.kept);
    rebuilt_islands += change.rebuilt_islands;
  }

  void draw_valid(GraphContact& contact) {
    GraphContact drawn = contact;
    if (draw_pair(drawn)) contact = drawn;
  }

  std::mt19937 random_;
  std::uint32_t body_range_;
  std::uint64_t next_id_ = 1;

 public:
  Offset rebuilt_islands = 0;
};

}  // namespace stiction::test
