#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "stiction/contact_graph.hpp"
#include "stiction/error.hpp"

namespace {

using namespace stiction;

using Pair = std::pair<Index, Index>;

Pair pair_of(const GraphContact& contact) {
  return std::minmax(contact.body_a, contact.body_b);
}

/// The page's formula for the priority of a pair, written down once more.
std::uint64_t priority(const Pair& pair) {
  std::uint64_t x = (static_cast<std::uint64_t>(static_cast<std::uint32_t>(pair.first)) << 32) +
                    static_cast<std::uint32_t>(pair.second) + 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// What is present, and everything derived by brute force from the definitions.
struct Oracle {
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

void expect_equal(const ContactGraph& graph, const Oracle& oracle) {
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
  Oracle oracle;

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

TEST(ContactGraph, AfterEveryChangeEverythingIsWhatTheDefinitionsSay) {
  Offset rebuilt = 0, split = 0, largest = 0;
  for (std::uint32_t seed = 1; seed <= 8; ++seed) {
    Changer changer(seed, 6 * seed);
    for (std::uint32_t k = 0; k < 4 * seed; ++k) changer.toggle_body();
    for (int step = 0; step < 500; ++step) {
      const Offset before = changer.graph.statistics().island_count;
      changer.change();
      split += changer.graph.statistics().island_count > before ? 1 : 0;
      largest = std::max(largest, changer.graph.statistics().edge_count);
      expect_equal(changer.graph, changer.oracle);
      ContactGraph rebuilt_graph = changer.graph;
      rebuilt_graph.rebuild();
      ASSERT_EQ(rebuilt_graph.manifolds(), changer.graph.manifolds());
      ASSERT_EQ(rebuilt_graph.islands(), changer.graph.islands());
      if (HasFatalFailure()) FAIL() << "seed " << seed << ", step " << step;
    }
    rebuilt += changer.rebuilt_islands;
  }
  EXPECT_GT(split, 100) << "the sequences must contain what is hard";
  EXPECT_GT(rebuilt, 0);
  EXPECT_GT(largest, 50);
}

TEST(ContactGraph, TheSameContactsGiveTheSameStateWhateverCameBefore) {
  Changer changer(77, 60);
  for (int k = 0; k < 50; ++k) changer.toggle_body();
  for (int step = 0; step < 2000; ++step) changer.change();
  ContactGraph fresh;
  for (auto body = changer.oracle.bodies.rbegin(); body != changer.oracle.bodies.rend(); ++body)
    fresh.add_body(body->first, body->second);
  fresh.update(changer.graph.contacts());
  ASSERT_GT(fresh.statistics().contact_count, 10);
  EXPECT_EQ(fresh.manifolds(), changer.graph.manifolds());
  EXPECT_EQ(fresh.islands(), changer.graph.islands());

  ContactGraph rebuilt = changer.graph;
  rebuilt.rebuild();
  expect_equal(rebuilt, changer.oracle);
  rebuilt.remove_contact(changer.oracle.contacts.begin()->first);
  EXPECT_TRUE(changer.graph.has_contact(changer.oracle.contacts.begin()->first)) << "a copy is apart";
}

/// Bodies 0..n-1 in a row, contact k between k and k + 1.
ContactGraph chain(Index n) {
  ContactGraph graph;
  std::vector<GraphContact> contacts;
  for (Index body = 0; body < n; ++body) graph.add_body(body);
  for (Index body = 0; body + 1 < n; ++body) contacts.push_back({static_cast<std::uint64_t>(body), body, body + 1});
  graph.update(contacts);
  return graph;
}

// In random order the manifold at distance j along a chain can only depend on a change if all in between fall in
// priority: probability 1/(j+1)!. Both ways, and the manifold itself: at most 1 + 2 (e - 2) = 2.44 on average.
TEST(ContactGraph, AChangeInALongChainRecolorsAFewManifoldsWhateverItsLength) {
  for (const Index n : {100, 3000}) {
    ContactGraph graph = chain(n);
    Offset evaluated = 0, most = 0, changes = 0;
    for (Index k = 0; k + 1 < n; k += n / 50) {
      const GraphContact contact = graph.contact(static_cast<std::uint64_t>(k));
      for (const GraphChange& change : {graph.remove_contact(contact.id), graph.add_contact(contact)}) {
        evaluated += change.evaluated_manifolds;
        most = std::max(most, change.evaluated_manifolds);
        ++changes;
      }
    }
    EXPECT_LE(static_cast<double>(evaluated), 2.44 * static_cast<double>(changes)) << n;
    EXPECT_LE(most, 12) << n;
    EXPECT_GE(changes, 100);
    EXPECT_EQ(graph.statistics().color_count, chain(n).statistics().color_count);
  }
}

TEST(ContactGraph, ABrokenChainIsSearchedOnTheShorterSide) {
  ContactGraph graph = chain(10000);
  EXPECT_LE(graph.remove_contact(9).searched_edges, 2 * 20);  // ten bodies before the break, each link seen from both
  EXPECT_EQ(graph.statistics().island_count, 2);
  EXPECT_EQ(graph.island(9), 0);
  EXPECT_EQ(graph.island(9999), 10);
  EXPECT_LE(graph.remove_contact(9990).searched_edges, 2 * 20);
  EXPECT_EQ(graph.island(9991), 9991);
  EXPECT_EQ(graph.islands()[1].contact_count, 9980);
}

TEST(ContactGraph, AnotherContactOfThePairAndAKeptStepTouchNothing) {
  ContactGraph graph = chain(5);
  const GraphChange twin = graph.add_contact({100, 2, 1});
  EXPECT_EQ(twin.evaluated_manifolds + twin.searched_edges, 0);
  EXPECT_EQ(graph.contact_count(1, 2), 2);
  EXPECT_EQ(graph.contact_count(2, 1), 2);
  EXPECT_EQ(graph.contact(100).body_a, 2) << "as given";
  const GraphChange still = graph.update(graph.contacts());
  EXPECT_EQ(still.kept, 5);
  EXPECT_EQ(still.added + still.removed + still.moved + still.evaluated_manifolds + still.searched_edges, 0);
  EXPECT_EQ(graph.remove_contact(1).searched_edges, 0);
  EXPECT_EQ(graph.statistics().island_count, 1);
}

TEST(ContactGraph, FixedBodiesNeitherJoinNorConflict) {
  ContactGraph graph;
  for (Index body = 0; body < 4; ++body) graph.add_body(body);
  graph.add_body(7, BodyRole::fixed);
  for (std::uint64_t k = 0; k < 4; ++k) {
    graph.add_contact({k, static_cast<Index>(k), 7});
    graph.add_contact({k + 4, kWorldBody, static_cast<Index>(k)});
  }
  const GraphStatistics stats = graph.statistics();
  EXPECT_EQ(stats.island_count, 4);
  EXPECT_EQ(stats.edge_count, 0);
  EXPECT_EQ(stats.color_count, 2) << "each body's two contacts conflict, nothing else does";
  EXPECT_EQ(graph.degree(7), 4);
  EXPECT_EQ(graph.island(7), -1);
  EXPECT_EQ(graph.island(kWorldBody), -1);
  EXPECT_EQ(graph.remove_body(7).removed, 4);
  EXPECT_EQ(graph.statistics().color_count, 1);
}

TEST(ContactGraph, MisuseIsNamedAndChangesNothing) {
  ContactGraph graph = chain(3);
  graph.add_body(5, BodyRole::fixed);
  const auto refuses = [&](auto action, const std::string& words) {
    const auto contacts = graph.contacts();
    const auto manifolds = graph.manifolds();
    try {
      action();
      ADD_FAILURE() << "accepted: " << words;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::invalid_argument);
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
    EXPECT_EQ(graph.contacts(), contacts);
    EXPECT_EQ(graph.manifolds(), manifolds);
  };
  using List = std::vector<GraphContact>;
  refuses([&] { graph.add_body(1); }, "body = 1: is in the graph already");
  refuses([&] { graph.add_body(-1); }, "body = -1");
  refuses([&] { graph.remove_body(9); }, "body = 9: is not in the graph");
  refuses([&] { graph.remove_body(-1); }, "the world stays");
  refuses([&] { graph.add_contact({0, 0, 2}); }, "contact 0: is in the graph already");
  refuses([&] { graph.add_contact({8, 0, 4}); }, "contact 8: body 4 is not in the graph");
  refuses([&] { graph.add_contact({8, 2, 2}); }, "body 2 touches itself");
  refuses([&] { graph.add_contact({8, -1, 5}); }, "the world and body 5 both never move");
  refuses([&] { graph.remove_contact(8); }, "contact 8: is not in the graph");
  refuses([&] { graph.update_contact({8, 0, 1}); }, "contact 8: is not in the graph");
  refuses([&] { graph.update_contact({1, 0, 4}); }, "body 4 is not in the graph");
  refuses([&] { graph.update(List{{0, 0, 1}, {7, 1, 2}, {7, 0, 2}}); }, "contact 7: is in the list twice");
  refuses([&] { graph.update(List{{0, 0, 1}, {0, 0, 1}}); }, "contact 0: is in the list twice");
  refuses([&] { graph.update(List{{9, 0, 1}, {1, 0, 4}}); }, "contact 1: body 4 is not in the graph");
  refuses([&] { (void)graph.color(99); }, "contact 99");
  refuses([&] { (void)graph.island(99); }, "body = 99");
  refuses([&] { (void)graph.degree(-1); }, "body = -1");
  EXPECT_EQ(graph.update(graph.contacts()).kept, 2) << "a refused list leaves no trace";
}

}  // namespace
