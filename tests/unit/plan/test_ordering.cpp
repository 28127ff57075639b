#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "core/job/block_pattern.hpp"
#include "core/plan/ordering.hpp"
#include "stiction/error.hpp"

namespace stiction::test {
namespace {

/// A graph as a pattern with every diagonal.
struct Graph {
  std::vector<Index> offsets{0}, columns;
  Graph(Index rows, const std::vector<std::pair<Index, Index>>& edges) {
    std::vector<std::set<Index>> row(static_cast<std::size_t>(rows));
    for (Index i = 0; i < rows; ++i) row[static_cast<std::size_t>(i)].insert(i);
    for (const auto& [a, b] : edges) {
      row[static_cast<std::size_t>(a)].insert(b);
      row[static_cast<std::size_t>(b)].insert(a);
    }
    for (const auto& entries : row) {
      columns.insert(columns.end(), entries.begin(), entries.end());
      offsets.push_back(static_cast<Index>(columns.size()));
    }
  }
  [[nodiscard]] BlockPattern pattern() const {
    const auto rows = static_cast<Index>(offsets.size()) - 1;
    return {rows, rows, offsets.data(), columns.data()};
  }
};

/// The rows of a grid, or with height 1 of a chain, numbered at random.
Graph shuffled_grid(Index width, Index height) {
  std::vector<Index> number(static_cast<std::size_t>(width * height));
  std::iota(number.begin(), number.end(), 0);
  std::shuffle(number.begin(), number.end(), std::mt19937(5));
  const auto at = [&](Index x, Index y) { return number[static_cast<std::size_t>(y * width + x)]; };
  std::vector<std::pair<Index, Index>> edges;
  for (Index y = 0; y < height; ++y)
    for (Index x = 0; x < width; ++x) {
      if (x + 1 < width) edges.emplace_back(at(x, y), at(x + 1, y));
      if (y + 1 < height) edges.emplace_back(at(x, y), at(x, y + 1));
    }
  return {width * height, edges};
}

std::vector<Graph> graphs() {
  std::vector<std::pair<Index, Index>> clique, star, pairs;
  for (Index b = 0; b < 14; ++b)
    for (Index a = 0; a < b; ++a) clique.emplace_back(a, b);
  for (Index b = 1; b < 40; ++b) star.emplace_back(0, b);
  for (Index b = 0; b < 10; ++b) pairs.emplace_back(b, 19 - b);
  return {Graph(0, {}),     Graph(1, {}),         Graph(7, {}),          Graph(14, clique),    Graph(40, star),
          Graph(20, pairs), shuffled_grid(50, 1), shuffled_grid(17, 11), shuffled_grid(30, 30)};
}

/// The farthest that an entry lies from the diagonal once the rows are in order.
Index bandwidth(const Graph& graph, const std::vector<Index>& order) {
  std::vector<Index> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
  Index widest = 0;
  for (std::size_t row = 0; row < order.size(); ++row)
    for (Index k = graph.offsets[row]; k < graph.offsets[row + 1]; ++k)
      widest = std::max(
          widest,
          std::abs(position[row] - position[static_cast<std::size_t>(graph.columns[static_cast<std::size_t>(k)])]));
  return widest;
}

TEST(Ordering, EveryOrderingIsAPermutationOrSaysWhatToInstall) {
  for (int i = 0; i < kOrderingCount; ++i) {
    const auto ordering = static_cast<Ordering>(i);
    SCOPED_TRACE(to_string(ordering));
    for (const Graph& graph : graphs()) {
      if (!is_available(ordering)) {
        try {
          order_rows(graph.pattern(), ordering);
          ADD_FAILURE() << "no error";
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::unsupported);
          EXPECT_NE(std::string(error.what()).find("install it (Debian: lib"), std::string::npos) << error.what();
        }
        continue;
      }
      const std::vector<Index> order = order_rows(graph.pattern(), ordering);
      std::vector<Index> sorted = order, rows(graph.offsets.size() - 1);
      std::sort(sorted.begin(), sorted.end());
      std::iota(rows.begin(), rows.end(), 0);
      EXPECT_EQ(sorted, rows);
    }
  }
}

TEST(Ordering, TheDefaultAndTheNaturalOrderAreInEveryBuild) {
  EXPECT_TRUE(is_available(kDefaultOrdering));
  EXPECT_TRUE(is_available(Ordering::natural));
  const Graph graph = shuffled_grid(5, 1);
  EXPECT_EQ(order_rows(graph.pattern(), Ordering::natural), (std::vector<Index>{0, 1, 2, 3, 4}));
}

TEST(Ordering, ThePatternAloneDecides) {
  const Graph graph = shuffled_grid(30, 30), other = shuffled_grid(40, 20);
  for (int i = 0; i < kOrderingCount; ++i) {
    const auto ordering = static_cast<Ordering>(i);
    if (!is_available(ordering)) continue;
    const std::vector<Index> alone = order_rows(graph.pattern(), ordering);
    // Two at once, for a library that keeps its random numbers in one place.
    std::vector<Index> beside;
    std::thread neighbour([&] {
      for (int k = 0; k < 5; ++k) order_rows(other.pattern(), ordering);
    });
    for (int k = 0; k < 5; ++k) {
      beside = order_rows(graph.pattern(), ordering);
      EXPECT_EQ(beside, alone) << to_string(ordering);
    }
    neighbour.join();
  }
}

TEST(Ordering, CuthillMckeeFindsTheNarrowestBandOfChainsAndGrids) {
  const Graph chain = shuffled_grid(50, 1), grid = shuffled_grid(30, 8);
  const auto order = [](const Graph& graph) { return order_rows(graph.pattern(), Ordering::reverse_cuthill_mckee); };
  EXPECT_EQ(bandwidth(chain, order(chain)), 1);
  EXPECT_EQ(bandwidth(grid, order(grid)), 8);
  EXPECT_GT(bandwidth(grid, order_rows(grid.pattern(), Ordering::natural)), 100) << "nothing to find";
}

TEST(Ordering, APatternThatNoSymmetricMatrixHasIsRefused) {
  const std::vector<Index> offsets{0, 1, 2}, columns{0, 0};
  EXPECT_THROW(order_rows({2, 2, offsets.data(), columns.data()}, Ordering::natural), Error) << "no diagonal";
  EXPECT_THROW(order_rows({2, 3, offsets.data(), columns.data()}, Ordering::natural), Error) << "not square";
}

}  // namespace
}  // namespace stiction::test
