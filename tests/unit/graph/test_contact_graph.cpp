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
#include "tests/support/oracles/graph_oracle.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

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
// priority. It has probability 1/(j+1)!. Both ways, and the manifold itself: at most 1 + 2 (e - 2) = 2.44 on
// average.
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
