#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "core/plan/color.hpp"

namespace {

using stiction::color_graph;
using stiction::Coloring;
using stiction::Index;

struct Graph {
  std::vector<Index> offsets{0}, neighbours;

  [[nodiscard]] Index vertex_count() const { return static_cast<Index>(offsets.size()) - 1; }
  [[nodiscard]] Index max_degree() const {
    Index largest = 0;
    for (std::size_t v = 1; v < offsets.size(); ++v) largest = std::max(largest, offsets[v] - offsets[v - 1]);
    return largest;
  }
};

Graph graph_of(Index vertex_count, const std::set<std::pair<Index, Index>>& edges) {
  std::vector<std::vector<Index>> adjacent(static_cast<std::size_t>(vertex_count));
  for (const auto& [u, v] : edges) {
    adjacent[static_cast<std::size_t>(u)].push_back(v);
    adjacent[static_cast<std::size_t>(v)].push_back(u);
  }
  Graph graph;
  for (const auto& list : adjacent) {
    graph.neighbours.insert(graph.neighbours.end(), list.begin(), list.end());
    graph.offsets.push_back(static_cast<Index>(graph.neighbours.size()));
  }
  return graph;
}

Graph random_graph(std::mt19937& random, Index vertex_count, std::size_t edge_count) {
  std::set<std::pair<Index, Index>> edges;
  for (std::size_t k = 0; k < edge_count; ++k) {
    const auto u = static_cast<Index>(random() % static_cast<std::uint32_t>(vertex_count));
    const auto v = static_cast<Index>(random() % static_cast<std::uint32_t>(vertex_count));
    if (u != v) edges.insert({std::min(u, v), std::max(u, v)});
  }
  return graph_of(vertex_count, edges);
}

void expect_proper(const Graph& graph, const Coloring& coloring) {
  ASSERT_EQ(coloring.color.size(), static_cast<std::size_t>(graph.vertex_count()));
  std::set<Index> used;
  for (std::size_t v = 0; v < coloring.color.size(); ++v) {
    used.insert(coloring.color[v]);
    for (Index k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k) {
      const auto u = static_cast<std::size_t>(graph.neighbours[static_cast<std::size_t>(k)]);
      ASSERT_NE(coloring.color[v], coloring.color[u]) << "vertices " << v << " and " << u;
    }
  }
  ASSERT_EQ(used.size(), static_cast<std::size_t>(coloring.color_count));
  if (!used.empty()) {
    EXPECT_EQ(*used.begin(), 0);
    EXPECT_EQ(*used.rbegin(), coloring.color_count - 1);
  }
  EXPECT_LE(coloring.color_count, graph.vertex_count() > 0 ? graph.max_degree() + 1 : 0);
}

TEST(Color, NoVerticesNeedNoColour) {
  EXPECT_EQ(color_graph({}, {}).color_count, 0);
  const Graph none;
  EXPECT_EQ(color_graph(none.offsets, none.neighbours).color_count, 0);
  EXPECT_TRUE(color_graph(none.offsets, none.neighbours).color.empty());
}

TEST(Color, VerticesWithoutEdgesShareOneColour) {
  const Graph graph = graph_of(5, {});
  const Coloring coloring = color_graph(graph.offsets, graph.neighbours);
  EXPECT_EQ(coloring.color_count, 1);
  EXPECT_EQ(coloring.color, std::vector<Index>(5, 0));
}

TEST(Color, ACompleteGraphNeedsAColourForEachVertexInOrder) {
  std::set<std::pair<Index, Index>> edges;
  for (Index u = 0; u < 7; ++u) {
    for (Index v = u + 1; v < 7; ++v) edges.insert({u, v});
  }
  const Graph graph = graph_of(7, edges);
  const Coloring coloring = color_graph(graph.offsets, graph.neighbours);
  EXPECT_EQ(coloring.color_count, 7);
  EXPECT_EQ(coloring.color, (std::vector<Index>{0, 1, 2, 3, 4, 5, 6}));
}

TEST(Color, ACompleteBipartiteGraphNeedsTwoColours) {
  std::set<std::pair<Index, Index>> edges;
  for (Index u = 0; u < 4; ++u) {
    for (Index v = 4; v < 10; ++v) edges.insert({u, v});
  }
  const Graph graph = graph_of(10, edges);
  const Coloring coloring = color_graph(graph.offsets, graph.neighbours);
  EXPECT_EQ(coloring.color_count, 2);
  expect_proper(graph, coloring);
}

// Path 0-1-2-3 with a leaf 4 on 2. Degrees 1 2 3 1 1: order 2, 1, 0, 3, 4; so 2 -> 0, 1 -> 1, 0 -> 0, 3 -> 1, 4 -> 1.
TEST(Color, TheLargestDegreeIsColouredFirstAndTiesGoByIndex) {
  const Graph graph = graph_of(5, {{0, 1}, {1, 2}, {2, 3}, {2, 4}});
  EXPECT_EQ(color_graph(graph.offsets, graph.neighbours).color, (std::vector<Index>{0, 1, 0, 1, 1}));
}

TEST(Color, AVertexListedAsItsOwnNeighbourIsIgnored) {
  const std::vector<Index> offsets{0, 2, 3}, neighbours{0, 1, 0};
  EXPECT_EQ(color_graph(offsets, neighbours).color, (std::vector<Index>{0, 1}));
}

TEST(Color, RandomGraphsAreColouredProperlyWithAtMostOneColourMoreThanTheLargestDegree) {
  std::mt19937 random(20240501);
  for (int round = 0; round < 300; ++round) {
    const auto vertex_count = static_cast<Index>(1 + random() % 120);
    const Graph graph = random_graph(random, vertex_count, random() % 600);
    expect_proper(graph, color_graph(graph.offsets, graph.neighbours));
  }
}

TEST(Color, TheOrderInWhichNeighboursAreStoredDoesNotMatter) {
  std::mt19937 random(7);
  for (int round = 0; round < 50; ++round) {
    const Graph graph = random_graph(random, 60, 300);
    Graph shuffled = graph;
    for (std::size_t v = 0; v + 1 < shuffled.offsets.size(); ++v) {
      std::reverse(shuffled.neighbours.begin() + shuffled.offsets[v],
                   shuffled.neighbours.begin() + shuffled.offsets[v + 1]);
    }
    EXPECT_EQ(color_graph(graph.offsets, graph.neighbours).color,
              color_graph(shuffled.offsets, shuffled.neighbours).color);
  }
}

}  // namespace
