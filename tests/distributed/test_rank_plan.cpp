// Decisions of ranks together about bodies that none of them has all of: cells and colours.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <random>
#include <set>
#include <span>

#include "core/plan/colored_body_plan.hpp"
#include "distributed/transport/thread_transport.hpp"
#include "distributed/world/coloring.hpp"
#include "distributed/world/cuts.hpp"

namespace stiction::distributed {
namespace {

constexpr double kDeadline = 100;

TEST(Cuts, HaveThePartsOfABisectionOfAllPoints) {
  std::mt19937_64 random(6);
  for (const int ranks : {1, 2, 3, 4, 7}) {
    std::vector<Point> points;
    for (int k = 0; k < 200; ++k) {
      // Few values, so that numbers have to decide; coordinates that floats hold.
      const auto coordinate = [&] { return static_cast<double>(random() % 9) - 4; };
      points.push_back({coordinate() * 2, coordinate(), coordinate() * 0.25});
    }
    const std::vector<int> expected = bisect(points, ranks);
    run_thread_ranks(ranks, kDeadline, [&](Transport& transport) {
      std::vector<Index> number;
      std::vector<Point> own;
      for (Index k = 0; k < 200; ++k) {
        if (k * k % ranks != transport.rank()) continue;
        number.push_back(k);
        own.push_back(points[static_cast<std::size_t>(k)]);
      }
      const Cuts cuts(transport, number, own);
      for (Index k = 0; k < 200; ++k) {
        const auto at = static_cast<std::size_t>(k);
        EXPECT_EQ(cuts.owner(k, points[at]), expected[at]) << "point " << k << " of " << ranks << " ranks";
      }
    });
  }
}

std::size_t at(Index place) {
  return static_cast<std::size_t>(place);
}

/// Which bodies touch: contacts in order of bodies, some of them runs of up to three.
struct Graph {
  Index bodies = 0;
  std::vector<Index> a, b;
};

/// Body 3 is in a fifth of the pairs.
Graph random_graph(std::mt19937_64& random, Index bodies) {
  std::set<std::pair<Index, Index>> pairs;
  for (Index k = 0; k < 6 * bodies; ++k) {
    const auto draw = [&] { return static_cast<Index>(random() % static_cast<std::uint64_t>(bodies)); };
    Index a = k % 5 == 0 ? 3 : draw() - (k % 11 == 0 ? 1 : 0), b = draw();
    if (a > b) std::swap(a, b);
    if (a != b) pairs.insert({a, b});
  }
  Graph graph{bodies, {}, {}};
  for (const auto& [a, b] : pairs)
    for (std::uint64_t run = random() % 6; run < 6; run += 2) {
      graph.a.push_back(a);
      graph.b.push_back(b);
    }
  return graph;
}

/// `how`: make_body_plan()'s arguments beside the batch.
BodyPlanData plan_of(const Graph& graph, const auto& how) {
  const Offset body_offsets[] = {0, graph.bodies}, contact_offsets[] = {0, static_cast<Offset>(graph.a.size())};
  const std::vector<double> depth(graph.a.size());
  BodyBatchView<double> batch;
  batch.env_count = 1;
  batch.body_count = graph.bodies;
  batch.contact_count = contact_offsets[1];
  batch.env_body_offsets = body_offsets;
  batch.env_contact_offsets = contact_offsets;
  batch.body_a = graph.a.data();
  batch.body_b = graph.b.data();
  batch.depth = depth.data();
  return make_body_plan(batch, how);
}

/// By contact.
std::vector<Index> colors_of(const BodyPlanData& plan) {
  std::vector<Index> colors(plan.contact_order.size());
  for (Index color = 0; color < plan.color_count[0]; ++color) {
    const Index first = plan.color_offsets[at(color)], end = plan.color_offsets[at(color) + 1];
    for (Index p = plan.vertex_offsets[at(first)]; p < plan.vertex_offsets[at(end)]; ++p)
      colors[at(plan.contact_order[at(p)])] = color;
  }
  return colors;
}

/// Part of a graph that a rank has.
struct Part {
  Graph graph;  ///< numbers of bodies are the piece's
  PieceBodies bodies;
  std::vector<std::size_t> contacts;  ///< the whole's
};

Part part_of(const Graph& whole, const std::vector<int>& owner, int rank) {
  Part part;
  part.bodies.rank = rank;
  const auto is_own = [&](Index body) { return body >= 0 && owner[at(body)] == rank; };
  std::vector<char> is_here(at(whole.bodies), 0);
  for (Index body = 0; body < whole.bodies; ++body) is_here[at(body)] = is_own(body) ? 1 : 0;
  for (std::size_t c = 0; c < whole.a.size(); ++c) {
    if (!is_own(whole.a[c]) && !is_own(whole.b[c])) continue;
    part.contacts.push_back(c);
    for (const Index body : {whole.a[c], whole.b[c]})
      if (body >= 0) is_here[at(body)] = 1;
  }
  std::vector<Index> local(at(whole.bodies), -1);
  for (Index body = 0; body < whole.bodies; ++body) {
    if (is_here[at(body)] == 0) continue;
    local[at(body)] = part.graph.bodies++;
    part.bodies.body.push_back(body);
    part.bodies.owner.push_back(owner[at(body)]);
  }
  for (const std::size_t c : part.contacts) {
    part.graph.a.push_back(whole.a[c] < 0 ? -1 : local[at(whole.a[c])]);
    part.graph.b.push_back(local[at(whole.b[c])]);
  }
  return part;
}

TEST(ColorOverRanks, GivesTheColoursOfOneProcess) {
  std::mt19937_64 random(7);
  Index most_colors = 0;
  for (int trial = 0; trial < 8; ++trial) {
    const Graph graph = random_graph(random, 20 + 40 * (trial % 4));
    const BodyPlanData whole = plan_of(graph, Index{0});
    const std::vector<Index> expected = colors_of(whole);
    most_colors = std::max(most_colors, whole.color_count[0]);
    for (const int ranks : {1, 2, 3, 5}) {
      const std::vector<int> owner = random_owners(graph.bodies, ranks, static_cast<std::uint64_t>(trial));
      std::atomic<std::int64_t> all_waves = 0;
      run_thread_ranks(ranks, kDeadline, [&](Transport& transport) {
        const Part part = part_of(graph, owner, transport.rank());
        std::int64_t waves = 0;
        const ColorVertices together = [&](std::span<const PushedBodies> vertices, std::span<Index> colors) {
          return color_over_ranks(transport, part.bodies, vertices, colors, waves);
        };
        const BodyPlanData own = plan_of(part.graph, together);
        EXPECT_EQ(own.color_count[0], whole.color_count[0]);
        const std::vector<Index> colors = colors_of(own);
        for (std::size_t k = 0; k < part.contacts.size(); ++k)
          EXPECT_EQ(colors[k], expected[part.contacts[k]])
              << "contact " << part.contacts[k] << " of " << ranks << " ranks";
        all_waves += waves;
      });
      EXPECT_EQ(all_waves > 0, ranks > 1);
    }
  }
  EXPECT_GT(most_colors, 64);  // more than a word of bits
}

}  // namespace
}  // namespace stiction::distributed
